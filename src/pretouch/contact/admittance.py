"""Yielding to a push as long as it is felt: a virtual mass and damper in joint space that take energy and give none.

Each joint obeys M dv/dt = d(tau) - D v, integrated implicitly, with tau the external torque less its mean in free
motion. See docs/reaction.md for why joint space, and for the bound on the energy (Hannaford and Ryu 2002; Ferraguti
et al. 2015; both bound it with what they call passivity observer and energy tank).
"""

import math

import numpy as np

from pretouch.compiled import compiled
from pretouch.params import ReactionParams
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value


@value
class AdmittanceState:
    """Memory of the admittance of n joints."""

    mean: FloatArray
    """(2, n) residual torque filtered once and twice [Nm]; the latter is the mean in free motion."""
    samples: int
    """How many samples the mean holds."""
    torque: FloatArray
    """(n,) last residual less the mean [Nm]."""
    velocity: FloatArray
    """(n,) of the virtual mass [rad/s]."""
    side: FloatArray
    """(n,) sign of the torque that last drove each joint in this reaction, 0 for none."""
    tank: float
    """Energy taken from the push and not given back, with the start value [J]."""
    steady: FloatArray
    """(n,) torque filtered, without most of its noise [Nm]."""
    quiet: float
    """Time since that was beyond the dead band [s]."""


def admittance_init(n: int, params: ReactionParams) -> AdmittanceState:
    """Return the state of n joints at rest, before the first sample."""
    none = np.zeros(n)
    return AdmittanceState(np.zeros((2, n)), 0, none, none, none, params.start_energy_j, none, 0.0)


def dead_band(torque_limit: FloatArray, params: ReactionParams) -> FloatArray:
    """External torque (n,) that moves nothing [Nm], given the joints' torque limits (n,) [Nm]."""
    return params.dead_band_nm + params.dead_band_fraction * torque_limit


def learnt(state: AdmittanceState, residual: FloatArray, dt: float, params: ReactionParams) -> AdmittanceState:
    """Let a sample of free motion into the mean.

    Of two filters in a row the second takes in little of what has only begun: of a torque that has lasted for 60 ms
    less than one part in a hundred.
    """
    weight = max(1.0 - math.exp(-dt / params.mean_s), 1.0 / (state.samples + 1))
    none, mean, torque = np.zeros(len(residual)), np.empty((2, len(residual))), np.empty(len(residual))
    _learn(state.mean, residual, weight, mean, torque)
    return AdmittanceState(
        mean, min(state.samples + 1, 1_000_000), torque, none, none, params.start_energy_j, none, 0.0
    )  # fmt: skip


@compiled
def _learn(before: FloatArray, residual: FloatArray, weight: float, mean: FloatArray, torque: FloatArray) -> None:
    """Write the mean (2, n) after a sample, and what of the sample (n,) it leaves."""
    for j in range(len(residual)):
        mean[0, j] = before[0, j] + weight * (residual[j] - before[0, j])
        mean[1, j] = before[1, j] + weight * (mean[0, j] - before[1, j])
        torque[j] = residual[j] - mean[1, j]


def begun(
    state: AdmittanceState, model: RobotModel, kin: Kinematics, band: FloatArray, params: ReactionParams
) -> AdmittanceState:
    """Begin a reaction: at the speed that the torque would keep up, as far as the start energy allows."""
    drive = _shrunk(state.torque, band)
    velocity = drive / params.damping_nm_s
    energy = 0.5 * params.inertia_kg_m2 * float(velocity @ velocity)
    if energy > params.start_energy_j:
        velocity = velocity * math.sqrt(params.start_energy_j / energy)
    velocity = _no_faster(velocity, model, kin, params.speed_max_m_s)
    return AdmittanceState(
        state.mean, state.samples, state.torque, velocity, np.sign(drive), params.start_energy_j, state.torque, 0.0
    )


def yielded(
    state: AdmittanceState, model: RobotModel, kin: Kinematics, residual: FloatArray, command: FloatArray,
    band: FloatArray, dt: float, params: ReactionParams,
) -> AdmittanceState:  # fmt: skip
    """Move the virtual mass by one period under the torque that is felt.

    Args:
        state: memory.
        model: the arm.
        kin: its posture.
        residual: (n,) external torque [Nm].
        command: (n,) joint velocities commanded last [rad/s].
        band: (n,) dead band [Nm].
        dt: period [s].
        params: parameters.
    """
    p = params
    torque, velocity, side = residual - state.mean[1], np.empty(len(band)), np.empty(len(band))
    keep = math.exp(-dt / p.lag_s) if p.lag_s > 0 else 0.0
    tank = _yield(
        torque, state.torque, state.velocity, command, state.side, band, keep, p.inertia_kg_m2, p.damping_nm_s,
        p.reverse_band, dt, state.tank, p.tank_max_j, velocity, side,
    )  # fmt: skip
    velocity = _no_faster(velocity, model, kin, p.speed_max_m_s)
    steady = state.steady + (1.0 - math.exp(-dt / _STEADY_S)) * (torque - state.steady)
    quiet = 0.0 if bool((np.abs(steady) > band).any()) else state.quiet + dt
    return AdmittanceState(state.mean, state.samples, torque, velocity, side, tank, steady, quiet)


def _no_faster(velocity: FloatArray, model: RobotModel, kin: Kinematics, most: float) -> FloatArray:
    """Scale joint velocities (n,) [rad/s] so that no point of the body's axes is faster than `most` [m/s]."""
    body = model.body
    fastest = fastest_point(
        kin.position, kin.rotation, kin.anchor, kin.axis, model.moved_by, body.link, body.a, body.b, velocity
    )
    return velocity * (most / fastest) if fastest > most else velocity


_STEADY_S = 0.1
"""Time constant that takes the noise out of the torque [s]."""


@compiled
def _yield(
    torque: FloatArray, before: FloatArray, v: FloatArray, command: FloatArray, side: FloatArray, band: FloatArray,
    keep: float, inertia: float, damping: float, reverse: float, dt: float, tank: float, tank_max: float,
    velocity: FloatArray, sides: FloatArray,
) -> float:  # fmt: skip
    """Write the last line of arguments; return the energy in the tank [J]."""
    n, power = len(v), 0.0
    for i in range(n):
        # what acted in the last period, by the exact inverse of the estimate's lag over one period
        acted = (torque[i] - keep * before[i]) / (1.0 - keep)
        # the least energy that it gave, whichever of the two is true and whatever is wrong within the dead band
        power += min(torque[i] * v[i], acted * v[i]) - band[i] * abs(v[i])
        felt, now = _beyond(torque[i], band[i]), _beyond(acted, band[i])
        drive = 0.0
        if felt * now > 0.0:
            drive = felt if abs(felt) < abs(now) else now
        if drive * side[i] < 0.0:
            least = reverse * band[i]
            far = min(abs(torque[i]), abs(acted)) > least
            drive = drive if far else 0.0
        velocity[i] = (inertia * v[i] + dt * drive) / (inertia + dt * damping)
        sides[i] = side[i]
        if drive != 0.0:
            sides[i] = np.sign(drive)
        elif velocity[i] * command[i] <= 0.0:
            velocity[i] = 0.0
        elif abs(velocity[i]) > abs(command[i]):
            # nothing drives it: it is never asked for more than it does
            velocity[i] = command[i]
    tank = min(tank + dt * power, tank_max)
    if tank < 0.0:
        # no more to give: only what takes energy may move
        for i in range(n):
            acted = (torque[i] - keep * before[i]) / (1.0 - keep)
            if min(torque[i] * velocity[i], acted * velocity[i]) <= band[i] * abs(velocity[i]):
                velocity[i] = 0.0
    return tank


@compiled
def _beyond(torque: float, band: float) -> float:
    """How far a torque lies beyond the dead band, with its sign: never more than it is without a bias that small."""
    return np.sign(torque) * max(0.0, abs(torque) - band)


def _shrunk(torque: FloatArray, band: FloatArray) -> FloatArray:
    return np.sign(torque) * np.maximum(0.0, np.abs(torque) - band)


@compiled
def fastest_point(
    position: FloatArray, rotation: FloatArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray,
    link: IntArray, a: FloatArray, b: FloatArray, qd: FloatArray,
) -> float:  # fmt: skip
    """Speed [m/s] of the fastest end of any capsule's axis at joint velocities `qd` (n,) [rad/s].

    The speed along an axis is convex, so no point of it is faster than both its ends.
    """
    fastest = 0.0
    for c in range(len(link)):
        k = link[c]
        for end in (a[c], b[c]):
            point = rotation[k] @ end + position[k]
            vx, vy, vz = 0.0, 0.0, 0.0
            for j in range(len(qd)):
                if moved_by[k, j]:
                    x, y, z = point[0] - anchor[j, 0], point[1] - anchor[j, 1], point[2] - anchor[j, 2]
                    vx += (axis[j, 1] * z - axis[j, 2] * y) * qd[j]
                    vy += (axis[j, 2] * x - axis[j, 0] * z) * qd[j]
                    vz += (axis[j, 0] * y - axis[j, 1] * x) * qd[j]
            fastest = max(fastest, np.sqrt(vx * vx + vy * vy + vz * vz))
    return fastest
