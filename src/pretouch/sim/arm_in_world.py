"""One arm in a simulated world: its errors, sensors, own computer, and the port `Robot`. Time passes elsewhere."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Any, NamedTuple

import mujoco
import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sim.drive import Cogging, Friction, Impedance, Joints, MotionGenerator, TorqueSensors
from pretouch.sim.observer import observer_init, wrench_from_torques
from pretouch.sim.physics import Computer, Nominal, SimulatedArm, World
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import CONTACTS, ArmError, CableSpec
from pretouch.types import FloatArray, RobotState

TOUCH_N = 1.0
"""True force above which there is a contact [N]."""
_NO_FORCE = np.zeros(3)
_Past = tuple[float, FloatArray]
"""An instant, and (5, n) q, qd, q_d, qd_d and external torques at it."""


@dataclass(frozen=True, slots=True)
class Touch:
    """The beginning of a contact of the arm, after none."""

    time: float
    """[s]"""
    link: int
    """Index of the link that touches."""
    velocity: FloatArray
    """(3,) velocity of the touching point of the link before the contact [m/s], the arm's own base frame."""


class PointForce(NamedTuple):
    """A force on the arm at a point of it, frame of the world."""

    link: int
    """Index of the link it acts on."""
    point: FloatArray
    """(3,) where [m]."""
    force: FloatArray
    """(3,) on the arm [N]."""


class ArmInWorld:
    """One arm of a kind in a MuJoCo world: the port `Robot`.

    The control law and the observer use the nominal model and what the sensors say; the physics has other masses,
    a payload, joint friction, and contacts. What a real arm's owner cannot know is under `true_...`. Where nothing
    else is said, vectors are in the world's frame, which is the base frame of the arm that the world was built of.
    """

    mj_model: mujoco.MjModel
    mj_data: mujoco.MjData
    time: float
    """[s]"""

    def __init__(self, model: RobotModel, params: PlantParams, seed: int) -> None:
        """Draw an arm: the seed decides its errors and its noise."""
        params.check_joints(model.n, len(model.links))
        self.model, self.params, self._n = model, params, model.n
        rng = np.random.default_rng([seed, 1])
        self._rng = np.random.default_rng([seed, 2])
        self.error = ArmError(
            mass_factor=1.0 + params.mass_error * rng.uniform(-1, 1, len(model.links)),
            payload=params.payload_max_kg * rng.uniform(),
            armature=params.armature_kg_m2,
            cable=CableSpec(params.cable_n_m, params.cable_slack_m, params.cable_kg, params.cable_friction_n)
            if params.cable_n_m else None,
        )  # fmt: skip
        self._offset = np.array(params.torque_offset_nm) * rng.uniform(-1, 1, self._n)
        self._wander = np.random.default_rng([seed, 3])
        self._ripple_phase = rng.uniform(0, 2 * np.pi, self._n)
        self._know(params)

    def _know(self, params: PlantParams) -> None:
        """Put what is known of one arm in the place of what was drawn; the draws are the same either way."""
        if params.offsets_nm:
            self._offset = np.array(params.offsets_nm)
        if params.ripple_phases_rad:
            self._ripple_phase = np.array(params.ripple_phases_rad)
        if params.mass_factors:
            self.error = replace(self.error, mass_factor=np.array(params.mass_factors))
        if params.payload_kg is not None:
            self.error = replace(self.error, payload=params.payload_kg)

    @property
    def offset_nm(self) -> FloatArray:
        """Errors (n,) of the torque sensors that stay [Nm], which a real arm's owner cannot know."""
        return self._offset

    def before_each_step(self, call: Callable[[float], float | None]) -> None:
        """Have `call(time)` run before each physics step: hands and sensors are driven so.

        It may return until when it has nothing to do [s]. While nobody has, steps are taken in one go.
        """
        raise NotImplementedError

    def _enter(self, mj_model: mujoco.MjModel, mj_data: mujoco.MjData, joint: int, body: int, q: FloatArray) -> None:
        """Take the place of the arm whose first joint and world link have these indices; it is at q (n,) [rad]."""
        self.mj_model, self.mj_data, self.first_body = mj_model, mj_data, body
        """`first_body` is the index in MuJoCo's of what is link 0 of the arm: its links follow."""
        self._arm_geoms = {g for g in range(mj_model.ngeom) if self._on_arm(g)}
        n, data, own = self._n, mj_data, slice(joint, joint + self._n)
        # views into the simulation's memory, taken once: MuJoCo's attribute look-ups cost as much as the arithmetic
        joints = Joints(data.qpos[own], data.qvel[own], data.qfrc_applied[own])
        self._q = joints.q
        self.link_position, self.link_rotation = data.xpos[body:], data.xmat.reshape(-1, 3, 3)[body:]
        """(L', 3) origins [m] and (L', 3, 3) orientations of the links, then of whatever else moves."""
        self._q[:] = q
        mujoco.mj_forward(mj_model, data)
        mass, bias = self.model.mass_matrix_and_bias(q, np.zeros(n), np.zeros(n))
        self.stiffness = np.array(self.params.stiffness_nm_rad)
        """Of the joint impedance (n,) [Nm/rad]; `set_stiffness` changes it."""
        self._impedance = Impedance(
            self.stiffness.copy(), self._damping(mass), np.zeros(n), self.model.description.tau_max
        )
        # at rest the impedance settles where it holds what the model does not know; start there, not with a jerk
        self._q_d, self._qd_set = q + (data.qfrc_bias[own] - bias) / self.stiffness, np.zeros(n)
        dt = self.params.period_s
        zero = observer_init(mass, np.zeros(n))
        self._computer = Computer(
            q.copy(), np.zeros(n), bias, zero.residual, zero.integral, mass, self.params.observer_gain_1_s, dt
        )
        self._group(joints, data.qacc[own])
        self._states: deque[_Past] = deque(maxlen=1 + round(self.params.state_delay_s / dt))
        self._late_commands: deque[tuple[float, FloatArray]] = deque()
        self._states.append(self._now())
        self.true_force = _NO_FORCE
        """(3,) sum of the contact forces on the arm by everything else [N], at the last physics step."""
        self.true_log: list[tuple[float, FloatArray]] = []
        """(time, true_force) of every physics step since the log was last taken."""
        self.touches: list[Touch] = []
        """Each beginning of a contact since then."""
        mujoco.mj_forward(mj_model, data)

    def _on_arm(self, geom: int) -> bool:
        link = int(self.mj_model.geom_bodyid[geom]) - self.first_body
        return 0 <= link < len(self.model.links) and bool(self.model.moved_by[link].any())

    def _group(self, joints: Joints, qdd: FloatArray) -> None:
        """Put together what physics steps are given."""
        p, n = self.params, self._n
        keep = float(np.exp(-2 * np.pi * p.torque_noise_hz * p.period_s))
        follow = 1.0 - float(np.exp(-2 * np.pi * p.set_point_hz * p.period_s))
        self._generator = generator = MotionGenerator(self._q_d, np.zeros(n), p.period_s, follow)
        self._cold, self._drift = np.array([p.cold_friction]), np.zeros(n)
        f1, f2, f3 = np.array([p.friction_f1_nm, p.friction_f2_s_rad, p.friction_f3_rad_s])
        friction = Friction(
            f1, f2, f3, np.zeros(n), p.bristle_nm,
            p.bristle_rad, p.stribeck, p.stribeck_rad_s, p.load_friction, self._cold,
        )  # fmt: skip
        ripple, cycles = np.array([p.ripple_nm, p.ripple_cycles])
        self._err = self._offset.copy()
        sensors = TorqueSensors(
            self._err, ripple, cycles, self._ripple_phase, np.zeros(n), keep, p.armature_kg_m2,
            p.friction_compensated, np.stack([self._computer.bias, np.zeros(n)]), 2 * np.pi * p.ring_hz * p.period_s,
            p.ring_damping,
        )  # fmt: skip
        cogging = Cogging(p.cogging * ripple, cycles, self._ripple_phase)
        data, (known, scratch) = self.mj_data, self.model.scratch
        counted = int(self.mj_model.sensor(CONTACTS).adr[0])
        world = World(self.mj_model._address, data._address, qdd, data.sensordata[counted : counted + 1])
        nominal = Nominal(known._address, scratch._address, scratch.qpos, scratch.qvel)
        self._qd_before = np.zeros(n)
        self._arm = SimulatedArm(
            world, joints, generator, self._impedance, friction, cogging, sensors, nominal, self._computer,
            self._qd_before,
        )  # fmt: skip
        # what is added to coloured noise at each step, so that its variance stays that of the sensor
        self._torque_noise = np.array(p.torque_noise_nm) * np.sqrt(1 - keep**2)

    def take_log(self) -> tuple[list[tuple[float, FloatArray]], list[Touch]]:
        """Return `true_log` and `touches`, and begin both anew: in a run without an end they would fill the memory."""
        taken, self.true_log, self.touches = (self.true_log, self.touches), [], []
        return taken

    @property
    def touching(self) -> bool:
        """Whether any two things touch, the arm or not."""
        return bool(self.mj_data.ncon)

    # the port Robot

    def read(self) -> RobotState:
        """Return what the arm's interface reports now."""
        p = self.params
        time, (q, qd, q_d, qd_set, tau_ext) = self._states[0] if p.state_delay_s else self._now()
        kin = self.model.kinematics(q)
        wrench = wrench_from_torques(self.model.ee_jacobian(kin), tau_ext, p.wrench_damping, p.singular_value_min)
        late = p.stamp_jitter_s * self._wander.uniform() if p.stamp_jitter_s else 0.0
        return RobotState(time + late, q, qd, q_d, qd_set, tau_ext, wrench)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point."""
        wanted = np.array(qd, dtype=np.float64)
        if self.params.command_delay_s:
            self._late_commands.append((self.time + self.params.command_delay_s, wanted))
        else:
            self._qd_set = wanted

    # its drives, for an interface that lets a client set them

    @property
    def desired(self) -> tuple[FloatArray, FloatArray]:
        """Positions [rad] and velocities [rad/s] (n,) that the motion generator asks for."""
        return self._q_d, self._generator.qd_d

    def drive_by(self, tau: FloatArray) -> None:
        """Have torques (n,) beyond gravity's [Nm] act in the next physics steps in place of the joint impedance."""
        impedance, own = self._impedance, self._computer
        _, gravity = self.model.mass_matrix_and_bias(own.q, np.zeros(self._n), np.empty(self._n))
        impedance.stiffness[:] = impedance.damping[:] = 0.0
        # the drives add what the model says of Coriolis torques, too, which a commanded torque has to itself
        impedance.feed_forward[:] = tau + gravity - own.bias

    def begin_at(self, q: FloatArray) -> None:
        """Have the motion generator ask for q (n,) [rad], near where the arm is, at once and at rest."""
        self._q_d[:], self._generator.qd_d[:] = q, 0.0

    def hold(self) -> None:
        """Have the joint impedance act again, where the arm is, within its limits, and with the velocities it has."""
        impedance, own = self._impedance, self._computer
        impedance.stiffness[:], impedance.damping[:] = self.stiffness, self._damping(own.mass_matrix)
        impedance.feed_forward[:] = 0.0
        self._q_d[:], self._generator.qd_d[:] = np.clip(own.q, self.model.q_min, self.model.q_max), own.qd

    def set_stiffness(self, stiffness: FloatArray) -> None:
        """Give the joint impedance another stiffness (n,) [Nm/rad], with the same damping ratio."""
        self.stiffness = stiffness.copy()
        self._impedance.stiffness[:] = stiffness
        self._impedance.damping[:] = self._damping(self._computer.mass_matrix)

    def _damping(self, mass_matrix: FloatArray) -> FloatArray:
        inertia = np.diag(mass_matrix) + self.params.armature_kg_m2
        return 2.0 * self.params.damping_ratio * np.sqrt(self.stiffness * inertia)

    def _now(self) -> _Past:
        own = self._computer
        return self.time, np.array([own.q, own.qd, self._q_d, self._qd_set, own.residual])

    def _note_contacts(self, times: list[float]) -> None:
        """Note what touched in steps that ended at these instants [s]: nothing, but for the last of them."""
        touched = self.true_force is not _NO_FORCE
        self.true_force = self._contact_force() if self.touching else _NO_FORCE
        self.true_log += zip(times[:-1], repeat(_NO_FORCE))
        self.true_log.append((self.time, self.true_force))
        if self.true_force is not _NO_FORCE and not (touched and len(times) == 1):
            self.touches.append(self._touch(self._qd_before))

    def _age(self, duration: float) -> None:
        """Let the arm warm up and its sensors drift (Ornstein-Uhlenbeck) for a time [s]."""
        p = self.params
        self._cold[0] = p.cold_friction * np.exp(-self.time / p.warm_up_s)
        if p.drift_nm:
            keep = np.exp(-duration / p.drift_s)
            self._drift = keep * self._drift + p.drift_nm * np.sqrt(1.0 - keep**2) * self._wander.standard_normal(
                self._n
            )
            self._err[:] = self._offset + self._drift

    def _touch(self, qd: FloatArray) -> Touch:
        """Describe the first contact there is; `qd` (n,) are the joint velocities before it [rad/s]."""
        contact, sign = next(found for found in map(self._on_the_arm, range(self.mj_data.ncon)) if found[1])
        geom = int(contact.geom2) if sign > 0 else int(contact.geom1)
        link = int(self.mj_model.geom_bodyid[geom]) - self.first_body
        kin = self.model.kinematics(self._q)
        return Touch(self.time, link, self.model.jacobian(kin, link, self._in_base(contact.pos.copy()))[:3] @ qd)

    def _in_base(self, point: FloatArray) -> FloatArray:
        """Return a point (3,) of the world in the arm's own base frame [m]."""
        return point

    def contact_forces(self) -> list[PointForce]:
        """Return the forces of all contacts of the arm with anything else, at the last physics step."""
        found, wrench = [], np.zeros(6)
        for i in range(self.mj_data.ncon):
            contact, sign = self._on_the_arm(i)
            if sign:
                mujoco.mj_contactForce(self.mj_model, self.mj_data, i, wrench)
                geom = int(contact.geom2) if sign > 0 else int(contact.geom1)
                force = sign * (contact.frame.reshape(3, 3).T @ wrench[:3])
                link = int(self.mj_model.geom_bodyid[geom]) - self.first_body
                found.append(PointForce(link, contact.pos.copy(), force))
        return found

    def _contact_force(self) -> FloatArray:
        """Sum of contact forces on the arm (3,) [N]; `_NO_FORCE` itself if nothing touches it."""
        total = _NO_FORCE
        for one in self.contact_forces():
            total = total + one.force
        return total

    def _on_the_arm(self, number: int) -> tuple[Any, int]:
        """Return a contact, and the sign its force has on the arm: MuJoCo's acts on the second geom; 0 elsewhere."""
        contact = self.mj_data.contact[number]
        if int(contact.geom2) in self._arm_geoms:
            return contact, 1
        return contact, -1 if int(contact.geom1) in self._arm_geoms else 0
