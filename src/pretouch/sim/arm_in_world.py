"""One arm in a simulated world: its errors, sensors, own computer, and the port `Robot`. Time passes elsewhere."""

from collections import deque
from collections.abc import Callable, Iterator
from itertools import repeat
from typing import Any, NamedTuple

import mujoco
import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sim.observer import wrench_from_torques
from pretouch.sim.physics import ArmMemory, Computer, Drives, Friction, Simulation, TorqueSensors
from pretouch.sim.plant_params import Joints, PlantParams
from pretouch.sim.scene import CONTACTS, ArmError
from pretouch.types import FloatArray, RobotState

TOUCH_N = 1.0
"""True force above which there is a contact [N]."""
_NO_FORCE = np.zeros(3)
_Past = tuple[float, FloatArray]
"""An instant, and (5, n) q, qd, q_d, qd_d and external torques at it."""


class Touch(NamedTuple):
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
        self._rng, self._wander = np.random.default_rng([seed, 2]), np.random.default_rng([seed, 3])
        mass_factor = _known(params.mass_factors, 1.0 + params.mass_error * rng.uniform(-1, 1, len(model.links)))
        payload = params.payload_max_kg * rng.uniform()
        self.error = ArmError(params, mass_factor, payload if params.payload_kg is None else params.payload_kg)
        self._offset = _known(params.offsets_nm, np.array(params.torque_offset_nm) * rng.uniform(-1, 1, self._n))
        self._ripple_phase = _known(params.ripple_phases_rad, rng.uniform(0, 2 * np.pi, self._n))

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
        data, own = mj_data, slice(joint, joint + self._n)
        # views into the simulation's memory, taken once: MuJoCo's attribute look-ups cost as much as the arithmetic
        self._q = data.qpos[own]
        self.link_position, self.link_rotation = data.xpos[body:], data.xmat.reshape(-1, 3, 3)[body:]
        """(L', 3) origins [m] and (L', 3, 3) orientations of the links, then of whatever else moves."""
        self._q[:] = q
        mujoco.mj_forward(mj_model, data)
        self.stiffness = np.array(self.params.stiffness_nm_rad)
        """Of the joint impedance (n,) [Nm/rad]; `set_stiffness` changes it."""
        self._group(own)
        dt = self.params.period_s
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

    def _group(self, own: slice) -> None:
        """Put together what physics steps take: `own` are the arm's joints among MuJoCo's."""
        p, data, q, zero = self.params, self.mj_data, self._q.copy(), np.zeros(self._n)
        mass, bias = self.model.mass_matrix_and_bias(q, zero, zero.copy())
        keep = float(np.exp(-2 * np.pi * p.torque_noise_hz * p.period_s))
        follow = 1.0 - float(np.exp(-2 * np.pi * p.set_point_hz * p.period_s))
        counted = int(self.mj_model.sensor(CONTACTS).adr[0])
        world = Simulation(
            self.mj_model._address, data._address, self._q, data.qvel[own], data.qacc[own], data.qfrc_applied[own],
            data.sensordata[counted : counted + 1],
        )  # fmt: skip
        # at rest the impedance settles where it holds what the model does not know; start there, not with a jerk
        q_d, self._qd_set = q + (data.qfrc_bias[own] - bias) / self.stiffness, zero.copy()
        self._drives = Drives(
            q_d, zero.copy(), p.period_s, follow, self.stiffness.copy(), self._damping(mass), zero.copy(),
            self.model.description.tau_max,
        )  # fmt: skip
        self._cold, self._drift = np.array([p.cold_friction]), zero
        f1, f2, f3 = np.array([p.friction_f1_nm, p.friction_f2_s_rad, p.friction_f3_rad_s])
        friction = Friction(
            f1, f2, f3, zero.copy(), p.bristle_nm,
            p.bristle_rad, p.stribeck, p.stribeck_rad_s, p.load_friction, self._cold,
        )  # fmt: skip
        self._err = self._offset.copy()
        sensors = TorqueSensors(
            self._err, np.array(p.ripple_nm), np.array(p.ripple_cycles), self._ripple_phase, p.cogging, zero.copy(),
            keep, p.armature_kg_m2, p.friction_compensated, np.stack([bias, zero]), 2 * np.pi * p.ring_hz * p.period_s,
            p.ring_damping,
        )  # fmt: skip
        model, scratch = self.model.scratch
        self._computer = Computer(
            model._address, scratch._address, scratch.qpos, scratch.qvel, q, zero.copy(), bias, zero.copy(),
            zero.copy(), mass, p.observer_gain_1_s, p.period_s,
        )  # fmt: skip
        self._qd_before = zero.copy()
        self._arm = ArmMemory(world, self._drives, friction, sensors, self._computer, self._qd_before)
        # what is added to coloured noise at each step, so that its variance stays that of the sensor
        self._torque_noise = np.array(p.torque_noise_nm) * np.sqrt(1 - keep**2)

    def take_log(self) -> tuple[list[tuple[float, FloatArray]], list[Touch]]:
        """Return `true_log` and `touches`, and begin both anew: in a run without an end they would fill the memory."""
        log, self.true_log, self.touches = (self.true_log, self.touches), [], []
        return log

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
        set_point = np.array(qd, dtype=np.float64)
        if self.params.command_delay_s:
            self._late_commands.append((self.time + self.params.command_delay_s, set_point))
        else:
            self._qd_set = set_point

    # its drives, for an interface that lets a client set them

    @property
    def desired(self) -> tuple[FloatArray, FloatArray]:
        """Positions [rad] and velocities [rad/s] (n,) that the motion generator asks for."""
        return self._drives.q_d, self._drives.qd_d

    def drive_by(self, tau: FloatArray) -> None:
        """Have torques (n,) beyond gravity's [Nm] act in the next physics steps in place of the joint impedance."""
        drives, own = self._drives, self._computer
        _, gravity = self.model.mass_matrix_and_bias(own.q, np.zeros(self._n), np.empty(self._n))
        drives.stiffness[:] = drives.damping[:] = 0.0
        # the drives add what the model says of Coriolis torques, too, which a commanded torque has to itself
        drives.feed_forward[:] = tau + gravity - own.bias

    def begin_at(self, q: FloatArray) -> None:
        """Have the motion generator ask for q (n,) [rad], near where the arm is, at once and at rest."""
        self._drives.q_d[:], self._drives.qd_d[:] = q, 0.0

    def hold(self) -> None:
        """Have the joint impedance act again, where the arm is, within its limits, and with the velocities it has."""
        drives, own = self._drives, self._computer
        drives.stiffness[:], drives.damping[:] = self.stiffness, self._damping(own.mass_matrix)
        drives.feed_forward[:] = 0.0
        drives.q_d[:], drives.qd_d[:] = np.clip(own.q, self.model.q_min, self.model.q_max), own.qd

    def set_stiffness(self, stiffness: FloatArray) -> None:
        """Give the joint impedance another stiffness (n,) [Nm/rad], with the same damping ratio."""
        self.stiffness = stiffness.copy()
        self._drives.stiffness[:] = stiffness
        self._drives.damping[:] = self._damping(self._computer.mass_matrix)

    def _damping(self, mass_matrix: FloatArray) -> FloatArray:
        inertia = np.diag(mass_matrix) + self.params.armature_kg_m2
        return 2.0 * self.params.damping_ratio * np.sqrt(self.stiffness * inertia)

    def _now(self) -> _Past:
        own = self._computer
        return self.time, np.array([own.q, own.qd, self._drives.q_d, self._qd_set, own.residual])

    def _note_contacts(self, times: list[float]) -> None:
        """Note what touched in steps that ended at these instants [s]: nothing, but for the last of them."""
        touched = self.true_force is not _NO_FORCE
        self.true_force = sum((one.force for one in self.contact_forces()), start=_NO_FORCE)
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
        _, contact, link, _ = next(self._on_the_arm())
        kin = self.model.kinematics(self._q)
        return Touch(self.time, link, self.model.jacobian(kin, link, self._in_base(contact.pos.copy()))[:3] @ qd)

    def _in_base(self, point: FloatArray) -> FloatArray:
        """Return a point (3,) of the world in the arm's own base frame [m]."""
        return point

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
                if geom in self._arm_geoms:
                    yield number, contact, int(self.mj_model.geom_bodyid[geom]) - self.first_body, sign
                    break


def _known(values: Joints, drawn: FloatArray) -> FloatArray:
    """What is known of one arm takes the place of what was drawn; the draws are the same either way."""
    return np.array(values) if values else drawn
