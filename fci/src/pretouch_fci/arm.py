"""The simulated arm behind its control box: modes, motions, limits and reflexes, one millisecond at a time."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from pretouch.errors import ParameterError, RobotModelError
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import Hand, HandScript
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.sim.tcp_push import Pushes, TcpPush
from pretouch.types import FloatArray
from pretouch_fci.cartesian import CARTESIAN_LIMITS, ArmBody, CartesianPose, CartesianVelocity
from pretouch_fci.collision import DEFAULT_BEHAVIOR, Contacts, SelfCollision
from pretouch_fci.controllers import CARTESIAN_STIFFNESS, CartesianImpedance, ExternalTorques, guiding
from pretouch_fci.frames import Inertial, announce, frames_of, inertials
from pretouch_fci.gripper import Gripper, GripperObject
from pretouch_fci.kinds import JointPosition, JointVelocity, MotionKind, NoMotion
from pretouch_fci.limits import PERIOD_S, motion_limits
from pretouch_fci.motion import Motion, MotionEnding, Setpoint, TargetMotion
from pretouch_fci.units import ServedUnits, UnitsSetup
from pretouch_fci.wire import JOINTS, ControllerMode, Generator, RobotKind, RobotMode

SETTLE_S = 0.2
"""Time the arm stands before its time begins [s]: the observer's transient is over."""
_COMES_TO_REST = 500
"""So many milliseconds after a motion the arm has braked and no longer swings."""


@dataclass(frozen=True)
class ServedSetup:
    """Arm that is served, and the events that happen to it."""

    model: RobotModel
    kind: RobotKind
    q: FloatArray
    """(7,) where it stands at first [rad]."""
    scene: SceneSpec
    hand: HandScript | None = None
    """Motion of the scene's hand."""
    pushes: tuple[TcpPush, ...] = ()
    """Forces at the end-effector; their time begins as the arm has settled."""
    units: UnitsSetup | None = None
    """Its sensor units, if they are switched on."""
    object: GripperObject | None = None
    """Object between the fingers of its gripper."""
    seed: int = 0
    """Decides the arm's errors and noise."""


class ServedArm:
    """One arm, as its owner's client sees it. A context manager, for its units' sockets."""

    def __init__(self, setup: ServedSetup) -> None:
        """Let it stand; its time begins."""
        if setup.model.n != JOINTS:
            raise RobotModelError(
                f"{setup.model.description.name} has {setup.model.n} joints: FCI supports only arms with {JOINTS}"
                " joints."
            )
        model = RobotModel(setup.model.description)  # its own: what a client says of loads changes it
        self.model, self.kind = model, setup.kind
        self.plant = Plant(model, setup.scene, PlantParams(), setup.q, setup.seed)
        self.limits, self.contacts, self.frames = motion_limits(model, setup.kind), Contacts(), frames_of(model)
        self.torques, self._own = JointTorques(self.plant), SelfCollision(model)
        self.units = None if setup.units is None else ServedUnits(self.plant, setup.units, setup.seed)
        if setup.hand is not None:
            Hand(self.plant, setup.hand)
        self.pushes = Pushes(self.plant, setup.pushes, SETTLE_S)
        self.gripper = Gripper(setup.object)
        """Present state of the gripper: `carry` changes it."""
        self.mode = RobotMode.IDLE
        self.errors: tuple[str, ...] = ()
        """Present errors, by the vendor's names."""
        self.reflex_reason: tuple[str, ...] = ()
        """Errors that ended the last motion."""
        self.motion: Motion | None = None
        self.success_rate = 0.0
        """Fraction of the last commands of the motion that came in time; 0 while none runs."""
        self.qd, self.qdd = np.zeros(JOINTS), np.zeros(JOINTS)
        """Commanded velocities [rad/s] and accelerations [rad/s^2], (7,)."""
        self.cartesian_stiffness = CARTESIAN_STIFFNESS
        """(6,) of the Cartesian impedance, in the stiffness frame [N/m, Nm/rad]."""
        self.guiding_axes = np.ones(JOINTS, np.bool_)
        """Mask of the end-effector's axes, and of the elbow, that can be moved by hand in guiding mode."""
        self._flange, self._announced = inertials(model)[self.frames.flange], self.frames.load
        self._drives: ExternalTorques | CartesianImpedance | None = None
        self._since_motion, self._stop_pressed = _COMES_TO_REST, False
        for _ in range(round(SETTLE_S / PERIOD_S)):
            self._pass_time()
            if self.plant.true_force.any():  # from within an object it would be flung out
                raise ParameterError(
                    "The arm touches something where it stands at first: give another place to the object, or another"
                    " posture to the arm."
                )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.units is not None:
            self.units.close()

    @property
    def moving(self) -> bool:
        """True while a motion runs."""
        return self.motion is not None

    @property
    def at_rest(self) -> bool:
        """True if no motion runs and the arm has braked."""
        return self.motion is None and not self.qd.any()

    @property
    def singular(self) -> bool:
        """True if it is so near a singularity that it does not know the wrench on its end-effector, either."""
        return self.report.wrench is None

    @property
    def settled(self) -> bool:
        """True if it no longer swings after a motion, either."""
        return self.at_rest and self._since_motion >= _COMES_TO_REST and not self.led

    @property
    def led(self) -> bool:
        """True while somebody moves it by hand, or is about to."""
        return self.mode is RobotMode.GUIDING and self.pushes.under_way

    @property
    def body(self) -> ArmBody:
        """The arm and its end-effector as they are set now."""
        return ArmBody(self.model, self.frames, CARTESIAN_LIMITS[self.kind])

    def begin(self, generator: Generator, controller: ControllerMode, fastest: FloatArray | None = None) -> None:
        """Begin a motion of a kind that is served, at rest and without errors: whoever calls it has looked.

        With largest velocities, (7,) [rad/s], the arm itself finds the way.
        """
        external = None
        match controller:
            case ControllerMode.EXTERNAL:
                self._drives = external = ExternalTorques(self.model.description.tau_max, self.torques.desired)
            case ControllerMode.CARTESIAN_IMPEDANCE:
                self._drives = CartesianImpedance(self.plant, self.body, self.cartesian_stiffness, self.plant.stiffness)
        if fastest is None:
            self.motion = Motion(self.limits, controller, self._kind(generator), external)
        else:
            self.motion = TargetMotion(self.limits, controller, fastest)
        self.mode, self.reflex_reason = RobotMode.MOVE, ()
        self._own.forget()

    def _kind(self, generator: Generator) -> MotionKind:
        body = self.body
        match generator:
            case Generator.NONE:
                return NoMotion()
            case Generator.JOINT_POSITION:
                return JointPosition(self.limits)
            case Generator.JOINT_VELOCITY:
                return JointVelocity()
            case Generator.CARTESIAN_POSITION:
                return CartesianPose(body)
            case Generator.CARTESIAN_VELOCITY:
                return CartesianVelocity(body)

    def stop(self) -> None:
        """End the motion: the arm brakes."""
        self.motion, self._since_motion, self.success_rate = None, 0, 0.0
        self._hold()
        if self.mode is RobotMode.MOVE:
            self.mode = RobotMode.IDLE

    def _hold(self) -> None:
        """Have the drives' own joint impedance act: from where the arm is, it brakes."""
        if self._drives is not None:
            self._drives, self.qd = None, self.report.qd
            self.plant.hold()

    def press_stop(self, pressed: bool = True) -> None:
        """Press the user stop, or release it: a motion ends, and none begins until then."""
        self._stop_pressed = pressed
        self.press_guiding(False)

    def press_guiding(self, pressed: bool = True) -> None:
        """Press the buttons at the flange, or release them: at rest, the arm gives way along the axes that are free."""
        if not pressed and self.mode is RobotMode.GUIDING:
            self._hold()
            self._since_motion = 0
        elif pressed and self.at_rest and not self._stop_pressed:
            self._drives = guiding(self.plant, self.body, self.guiding_axes)
        if not self.moving:
            self.mode = self._unmoved_mode

    @property
    def _unmoved_mode(self) -> RobotMode:
        """The mode of an arm that neither moves nor is guided."""
        if self._stop_pressed:
            return RobotMode.USER_STOPPED
        if self._drives is not None:
            return RobotMode.GUIDING
        return RobotMode.REFLEX if self.errors else RobotMode.IDLE

    def recover(self) -> None:
        """Forget errors."""
        self.errors = ()
        self.contacts.forget()
        self.mode = self._unmoved_mode

    def forget_settings(self) -> None:
        """Undo what a client has set: the next one finds the arm as it was delivered."""
        self.contacts.behavior, self.frames = DEFAULT_BEHAVIOR, frames_of(self.model)
        self.cartesian_stiffness, self.guiding_axes = CARTESIAN_STIFFNESS, np.ones(JOINTS, np.bool_)
        self.plant.set_stiffness(np.array(self.plant.params.stiffness_nm_rad))
        self.announce(self.frames.load)

    def announce(self, load: Inertial) -> None:
        """Have the arm's own computer count a load at the flange, in the flange's frame."""
        if load.mass or self._announced.mass:
            announce(self.model, self.frames.flange, self._flange, load)
            self._since_motion = 0  # it holds another weight: the arm swings
        self.frames.load = self._announced = load

    def carry(self, gripper: Gripper) -> None:
        """Carry a gripper in another state from now on; with another load the arm swings, as after a motion."""
        if gripper.load_kg != self.gripper.load_kg:
            self.plant.grip(gripper.load_kg)
            self._since_motion = 0
        self.gripper = gripper

    def step(self, setpoint: Setpoint | None) -> MotionEnding | None:
        """Let a millisecond pass under the command that came for it, None if none did; say how a motion ended."""
        ending = None
        if self.motion is not None and self._stop_pressed:
            ending = MotionEnding("emergency")
            self.stop()
            self.mode = RobotMode.USER_STOPPED
        elif self.motion is not None:
            ending = self.motion.follow(self._place(self.motion, setpoint), setpoint)
            self.qd, self.qdd, self.success_rate = self.motion.qd, self.motion.qdd, self.motion.success_rate
            if ending is not None:
                self._end(ending.errors)
        if self.motion is None:
            slower = self.limits.braked(self.qd)
            self.qd, self.qdd = slower, (slower - self.qd) / PERIOD_S
            self._since_motion = 0 if self.led else self._since_motion + 1
        self.plant.command(self.qd)
        self._pass_time()
        return self._check_contacts() or self._check_joints() or ending

    def _place(self, motion: Motion, setpoint: Setpoint | None) -> FloatArray:
        """Return the commanded positions (7,) [rad]; an FR3's may begin where the arm measurably is.

        The vendor's own examples begin there since libfranka 0.15 (its changelog); those for the Panda do not.
        """
        if self.kind == "fr3" and setpoint is not None and motion.awaited and not motion.begun:
            start = motion.kind.start(setpoint.values, self.report.q)
            if start is not None:
                self.plant.begin_at(start)
                return start
        return self.report.q_commanded

    def _pass_time(self) -> None:
        tau = None if self._drives is None else self._drives.torques()
        if tau is not None:
            self.plant.drive_by(tau)
        self.plant.advance(PERIOD_S)
        self.report = self.plant.read()
        self.torques.update(self.report.q, tau)
        self.true_force = self.plant.true_force + self.pushes.force
        """(3,) all forces on the arm [N], base frame."""
        self.plant.take_log()

    def _check_contacts(self) -> MotionEnding | None:
        """Look for contacts; a collision is a reflex, which ends a motion."""
        wrench = np.zeros(6) if self.report.wrench is None else self.report.wrench
        reflexes = self.contacts.update(self.report.tau_ext, wrench, self.qdd)
        if not reflexes or self.mode in (RobotMode.REFLEX, RobotMode.GUIDING):
            return None
        moved = self.moving
        self._end(reflexes)
        return MotionEnding("reflex", reflexes) if moved else None

    def _check_joints(self) -> MotionEnding | None:
        """Look where a motion leads the joints; their limits are looked at before a commanded motion is followed."""
        if self.motion is None:
            return None
        q, driven = self.report.q, self.motion.controller is ControllerMode.EXTERNAL
        errors = self._own.update(q) or (self.limits.left(q, self.report.qd) if driven else ())
        if not errors:
            return None
        self._end(errors)
        return MotionEnding("reflex", errors)

    def _end(self, errors: tuple[str, ...]) -> None:
        self.stop()
        if errors:
            self.errors = self.reflex_reason = errors
            self.mode = RobotMode.REFLEX


class JointTorques:
    """Torques of motors and joints in the last physics step, without the errors of the torque sensors."""

    def __init__(self, plant: Plant) -> None:
        """Watch an arm."""
        self._plant, n, p = plant, plant.model.n, plant.params
        data = plant.mj_data
        self._applied, self._qd, self._qdd = data.qfrc_applied[:n], data.qvel[:n], data.qacc[:n]
        self._friction = np.array([p.friction_f1_nm, p.friction_f2_s_rad, p.friction_f3_rad_s])
        self._still = np.zeros(n)
        self._before = self._still
        self.measured, self.rate, self.desired = np.zeros(n), np.zeros(n), np.zeros(n)
        """(n,) torques on the side of the links [Nm] and their rate of change [Nm/s]; those asked for beyond gravity
        [Nm]."""
        self._sampled = False
        plant.before_each_step(self._keep)

    def _keep(self, _time: float) -> None:
        self._before = self._qd.copy()

    def update(self, q: FloatArray, tau: FloatArray | None = None) -> None:
        """Take in a physics step that led to measured positions q (n,) [rad], under torques (n,) if any were asked."""
        p, gravity = self._plant.params, np.empty(len(q))
        self._plant.model.mass_matrix_and_bias(q, self._still, gravity)
        lost = self._lost(self._before)
        motor = self._applied + lost
        measured = motor - p.armature_kg_m2 * self._qdd - p.friction_compensated * lost
        self.rate = (measured - self.measured) / p.period_s if self._sampled else self._still
        self.measured, self._sampled = measured, True
        self.desired = motor - gravity if tau is None else tau

    def _lost(self, qd: FloatArray) -> FloatArray:
        """Torques (n,) [Nm] lost to friction at velocities qd (n,) [rad/s]."""
        f1, f2, f3 = self._friction
        return f1 / (1 + np.exp(-f2 * (qd + f3))) - f1 / (1 + np.exp(-f2 * f3))
