"""The simulated arm behind its joint velocity interface: 1 kHz physics, joint impedance, sensors, observer."""

from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator
from itertools import accumulate, repeat
from typing import Any, NamedTuple

import mujoco
import numpy as np

from pretouch.errors import ParameterError
from pretouch.robot.model import RobotModel
from pretouch.sim.observer import wrench_from_torques
from pretouch.sim.physics import BIAS, QD_BEFORE, QD_D, HandMemory, memory_of, take_steps
from pretouch.sim.plant_params import Joints, PlantParams
from pretouch.sim.rays import Ranging
from pretouch.sim.scene import ArmError, SceneSpec, build
from pretouch.sim.under_way import ROUNDING_S
from pretouch.types import FloatArray, RobotState

TOUCH_N = 1.0
"""True force above which there is a contact [N]."""
_NO_FORCE = np.zeros(3)


class Touch(NamedTuple):
    """The beginning of a contact of the arm, after none."""

    time: float
    """[s]"""
    link: int
    """Index of the link that touches."""
    velocity: FloatArray
    """(3,) velocity of the touching point of the link before the contact [m/s], base frame."""


class PointForce(NamedTuple):
    """A force on the arm at a point of it, base frame."""

    link: int
    """Index of the link it acts on."""
    point: FloatArray
    """(3,) where [m]."""
    force: FloatArray
    """(3,) on the arm [N]."""


class Plant:
    """A simulated arm in a MuJoCo world, and the time in it: the port `Robot`.

    The control law and the observer use the nominal model and what the sensors say; the physics has other masses,
    a payload, joint friction, and contacts. What a real arm's owner cannot know is under `true_...`.
    """

    def __init__(self, model: RobotModel, scene: SceneSpec, params: PlantParams, q: FloatArray, seed: int) -> None:
        """Build an arm at rest at q (n,) [rad]; the seed decides its errors and its noise."""
        params.check_joints(model.n, len(model.links))
        self.model, self.scene, self.params, self._n = model, scene, params, model.n
        rng = np.random.default_rng([seed, 1])
        self._rng, self._wander = np.random.default_rng([seed, 2]), np.random.default_rng([seed, 3])
        self._drift = np.zeros(model.n)
        mass_factor = _known(params.mass_factors, 1.0 + params.mass_error * rng.uniform(-1, 1, len(model.links)))
        payload = params.payload_max_kg * rng.uniform()
        self.error = ArmError(params, mass_factor, payload if params.payload_kg is None else params.payload_kg)
        self.offset_nm = _known(params.offsets_nm, np.array(params.torque_offset_nm) * rng.uniform(-1, 1, self._n))
        """Errors (n,) of the torque sensors that stay [Nm], which a real arm's owner cannot know."""
        ripple_phase = _known(params.ripple_phases_rad, rng.uniform(0, 2 * np.pi, self._n))
        self._before_step: list[Callable[[float], float | None]] = []
        self._idle_until: list[float] = []
        self._ready: Callable[[], Ranging] | None = None
        self._chance: np.random.Generator | None = None
        self.time = 0.0
        """[s]"""
        self.mj_model, none = build(model, scene, self.error), np.empty(0)
        self.mj_data = mujoco.MjData(self.mj_model)
        self.hand = HandMemory(none, none, none, np.empty((0, 3)), np.empty((0, 9)), np.empty((0, 3)), none)
        """A person's hand; none yet."""
        self._begin(q, ripple_phase)

    def _begin(self, q: FloatArray, ripple_phase: FloatArray) -> None:
        """Let the arm stand at q (n,) [rad], with the phases (n,) of its joints' ripple [rad]."""
        mj_model, mj_data, own = self.mj_model, self.mj_data, slice(0, self._n)
        moving = np.flatnonzero(self.model.moved_by.any(axis=1))
        self._geom_link = np.where(np.isin(mj_model.geom_bodyid, moving), mj_model.geom_bodyid, -1)
        """Link of each geom, -1 for other objects."""
        # views into the simulation's memory, taken once: MuJoCo's attribute look-ups cost as much as the arithmetic
        self.link_position, self.link_rotation = mj_data.xpos, mj_data.xmat.reshape(-1, 3, 3)
        """(L', 3) origins [m] and (L', 3, 3) orientations of the links, then of whatever else moves."""
        mj_data.qpos[own] = q
        mujoco.mj_forward(mj_model, mj_data)
        self.stiffness = np.array(self.params.stiffness_nm_rad)
        """Stiffness of the joint impedance (n,) [Nm/rad]; `set_stiffness` changes it."""
        self._arm = memory_of(mj_model, mj_data, own, self.model, self.params, ripple_phase)
        self._arm.impedance[:2], self._arm.offset[:] = self._spring_and_damper(self._arm.mass_matrix), self.offset_nm
        # what is added to coloured noise at each step, so that its variance stays that of the sensor
        torque_noise = np.array(self.params.torque_noise_nm) * np.sqrt(1 - self._arm.keep**2)
        self._noise = np.array([np.full(self._n, self.params.velocity_noise_rad_s), torque_noise])
        self._measured_q, self._measured_qd, self._q_d, self._qd_set, _ = self._arm.report
        self._err = self._arm.offset
        delay = round(self.params.state_delay_s / self.params.period_s)
        self._states = deque([(self.time, self._arm.report.copy())], 1 + delay)
        self._late_commands: deque[tuple[float, FloatArray]] = deque()
        self.true_force = _NO_FORCE
        """(3,) sum of the contact forces on the arm by everything else [N], at the last physics step."""
        self.true_log: list[tuple[float, FloatArray]] = []
        """(time, true_force) of every physics step since the log was last taken."""
        self.touches: list[Touch] = []
        """Each beginning of a contact since then."""
        mujoco.mj_forward(mj_model, mj_data)

    def take_log(self) -> tuple[list[tuple[float, FloatArray]], list[Touch]]:
        """Return `true_log` and `touches`, and begin both anew: in a run without an end they would fill the memory."""
        log, self.true_log, self.touches = (self.true_log, self.touches), [], []
        return log

    @property
    def touching(self) -> bool:
        """True if any two objects touch, the arm or not."""
        return bool(self.mj_data.ncon)

    # the port Robot

    def read(self) -> RobotState:
        """Return what the arm's interface reports now."""
        p = self.params
        time, report = self._states[0] if p.state_delay_s else (self.time, self._arm.report.copy())
        q, qd, q_d, qd_set, tau_ext = report
        hinges, arm = self.model.hinges, self.model.mechanism.arm
        wrench = wrench_from_torques(hinges, arm, q, tau_ext, p.wrench_damping, p.singular_value_min)
        late = p.stamp_jitter_s * self._wander.uniform() if p.stamp_jitter_s else 0.0
        return RobotState(time + late, q, qd, q_d, qd_set, tau_ext, wrench)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point."""
        if self.params.command_delay_s:
            self._late_commands.append((self.time + self.params.command_delay_s, np.array(qd, dtype=np.float64)))
        else:
            self._qd_set[:] = qd

    # its drives, for an interface that lets a client set them

    @property
    def desired(self) -> tuple[FloatArray, FloatArray]:
        """Positions [rad] and velocities [rad/s] (n,) that the motion generator asks for."""
        return self._q_d, self._arm.state[QD_D]

    def drive_by(self, tau: FloatArray) -> None:
        """Have torques (n,) beyond gravity's [Nm] act in the next physics steps in place of the joint impedance."""
        _, gravity = self.model.mass_matrix_and_bias(self._measured_q, np.zeros(self._n), np.empty(self._n))
        # the drives add what the model says of Coriolis torques, too, which a commanded torque has to itself
        self._arm.impedance[:2], self._arm.impedance[2] = 0.0, tau + gravity - self._arm.state[BIAS]

    def begin_at(self, q: FloatArray) -> None:
        """Have the motion generator ask for q (n,) [rad], near where the arm is, at once and at rest."""
        self._q_d[:], self._arm.state[QD_D] = q, 0.0

    def hold(self) -> None:
        """Have the joint impedance act again, where the arm is, within its limits, and with the velocities it has."""
        self._arm.impedance[:2], self._arm.impedance[2] = self._spring_and_damper(self._arm.mass_matrix), 0.0
        self._q_d[:] = np.clip(self._measured_q, self.model.q_min, self.model.q_max)
        self._arm.state[QD_D] = self._measured_qd

    def set_stiffness(self, stiffness: FloatArray) -> None:
        """Give the joint impedance another stiffness (n,) [Nm/rad], with the same damping ratio."""
        self.stiffness = stiffness.copy()
        self._arm.impedance[:2] = self._spring_and_damper(self._arm.mass_matrix)

    def _spring_and_damper(self, mass_matrix: FloatArray) -> FloatArray:
        inertia = np.diag(mass_matrix) + self.params.armature_kg_m2
        return np.array([self.stiffness, 2.0 * self.params.damping_ratio * np.sqrt(self.stiffness * inertia)])

    def _note_contacts(self, times: list[float]) -> None:
        """Note what touched in steps that ended at these instants [s]: nothing, but for the last of them."""
        touched = self.true_force is not _NO_FORCE
        forces = self.contact_forces() if self.mj_data.ncon else []
        self.true_force = sum((one.force for one in forces), start=_NO_FORCE)
        self.true_log += zip(times[:-1], repeat(_NO_FORCE))
        self.true_log.append((self.time, self.true_force))
        if self.true_force is not _NO_FORCE and not (touched and len(times) == 1):
            _, contact, link, _ = next(self._on_the_arm())
            kin = self.model.kinematics(self._arm.world.q)
            jacobian = self.model.jacobian(kin, link, contact.pos.copy())
            self.touches.append(Touch(self.time, link, jacobian[:3] @ self._arm.state[QD_BEFORE]))

    def _age(self, duration: float) -> None:
        """Let the arm warm up and its sensors drift (Ornstein-Uhlenbeck) for a time [s]."""
        p = self.params
        self._arm.cold[0] = p.cold_friction * np.exp(-self.time / p.warm_up_s)
        if p.drift_nm:
            keep = np.exp(-duration / p.drift_s)
            drawn = p.drift_nm * np.sqrt(1.0 - keep**2) * self._wander.standard_normal(self._n)
            self._drift = keep * self._drift + drawn
            self._err[:] = self.offset_nm + self._drift

    def contact_forces(self) -> list[PointForce]:
        """Return the forces of all contacts of the arm with anything else, at the last physics step."""
        forces, wrench = [], np.zeros(6)
        for number, contact, link, sign in self._on_the_arm():
            mujoco.mj_contactForce(self.mj_model, self.mj_data, number, wrench)
            force = sign * (contact.frame.reshape(3, 3).T @ wrench[:3])
            forces.append(PointForce(link, contact.pos.copy(), force))
        return forces

    def _on_the_arm(self) -> Iterator[tuple[int, Any, int, int]]:
        """Each contact of the arm: its number, itself, the arm's link, and the sign its force has on the arm."""
        for number in range(self.mj_data.ncon):
            contact = self.mj_data.contact[number]
            for geom, sign in ((int(contact.geom2), 1), (int(contact.geom1), -1)):  # MuJoCo's acts on the second
                if (link := int(self._geom_link[geom])) >= 0:
                    yield number, contact, link, sign
                    break

    def before_each_step(self, call: Callable[[float], float | None]) -> None:
        """Have `call(time)` run before each physics step: hands and sensors are driven so.

        It may return until when it has nothing to do, if nothing touches before [s]. While nobody has, steps are taken
        in one go.
        """
        self._before_step.append(call)
        self._idle_until.append(-np.inf)

    def measure_each_step(self, ready: Callable[[], Ranging], rng: np.random.Generator) -> bool:
        """Have compiled code measure before each physics step with what `ready()` returns, for the first to ask.

        Return whether it will.
        """
        if self._ready is not None:
            return False
        self._ready, self._chance = ready, rng
        return True

    def advance(self, duration: float) -> None:
        """Let time pass [s], in whole physics steps."""
        p = self.params
        steps, done, noted = round(duration / p.period_s), 0, 0
        noise = self._noise * self._rng.standard_normal((steps, 2, self._n))
        past = np.empty((steps if p.state_delay_s else 0, 5, self._n))
        times = list(accumulate(repeat(p.period_s, steps), initial=self.time))
        begins = np.array(times)
        self._age(duration)
        while done < steps:
            first, until = done, self._prepare_step()
            last = bisect_left(times, until, first + 1, steps)
            ranging = self._ready() if self._ready else None
            done = take_steps(first, begins[:last], noise, past, self._arm, self.hand, ranging, self._chance)
            self.time = times[done]
            if self._arm.world.contacts[0]:
                self._idle_until = [-np.inf] * len(self._before_step)
            if p.state_delay_s:
                self._states.extend((times[step + 1], past[step]) for step in range(first, done))
            if done == steps or self._arm.world.contacts[0] or self.true_force is not _NO_FORCE:
                self._note_contacts(times[noted + 1 : done + 1])
                noted = done

    def _prepare_step(self) -> float:
        """Do what is due before the next physics step, and return up to when nothing else will be [s]."""
        time = self.time
        for i, call in enumerate(self._before_step):
            if time >= self._idle_until[i]:
                idle = call(time)
                self._idle_until[i] = -np.inf if idle is None else idle
        until, late = min(self._idle_until, default=np.inf), self._late_commands
        while late and late[0][0] <= time + ROUNDING_S:
            self._qd_set[:] = late.popleft()[1]
        return min(until, late[0][0] - 2 * ROUNDING_S) if late else until  # too early does no harm

    def grip(self, load_kg: float) -> None:
        """Carry a load at the TCP from now on [kg]; 0 puts it down. An arm that was built without a payload cannot."""
        if not self.error.payload > 0.0:
            raise ParameterError(
                "This arm has nothing at its TCP that could grip: give PlantParams.payload_kg above 0."
            )
        self.mj_model.body("payload").mass[:] = self.error.payload + load_kg


def _known(values: Joints, drawn: FloatArray) -> FloatArray:
    """Replace drawn values by those that are given for one arm; the draws are the same either way."""
    return np.array(values) if values else drawn


class PlantClock:
    """The port `Clock` of a simulated arm: each tick lets one control period pass."""

    def __init__(self, plant: Plant, period: float) -> None:
        """Take the arm and the control period [s]; one that is no whole number of physics steps is a ParameterError."""
        step = plant.params.period_s
        if round(period / step) < 1 or abs(period / step - round(period / step)) > 1e-6:
            raise ParameterError(
                f"The control period is {period:g} s: give a multiple of the physics step of {step:g} s."
            )
        self._plant, self._period = plant, period

    def tick(self) -> float:
        """Advance the physics by one period and return its time [s]."""
        self._plant.advance(self._period)
        return self._plant.time
