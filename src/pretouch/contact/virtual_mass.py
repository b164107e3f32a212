"""Yielding to a push as long as it lasts: a virtual mass and damper in joint space that only take energy.

Each joint obeys M dv/dt = d(tau) - D v, integrated implicitly, with tau the external torque less its mean in free
motion. See docs/explanation/reaction.md for why joint space, and for the bound on the energy (Hannaford and Ryu 2002;
Ferraguti et al. 2015, whose passivity observer and energy tank it uses). The speed of all points of the body's axes is
bounded, and so is their distance from the start.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.params import AdmittanceParams
from pretouch.records import Cell, IntCell, zeros
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Chain, Kinematics, dot, point_velocity
from pretouch.types import BoolArray, FloatArray

Axes = tuple[Kinematics, BoolArray, Capsules]
"""Posture of an arm, the joints that move each link (L, n), and the capsules of its body."""


MARKS = 12
"""Number of marks of the path before the contact."""


class VirtualMass(NamedTuple):
    """The virtual mass of n joints, with the memory of its torque and of the path before the contact."""

    mean: Annotated[FloatArray, 2, "n"]
    """(2, n) residual torque filtered once and twice [Nm]; the latter is the mean in free motion."""
    samples: IntCell
    """Number of samples in the mean."""
    torque: Annotated[FloatArray, "n"]
    """(n,) last residual less the mean [Nm]."""
    velocity: Annotated[FloatArray, "n"]
    """(n,) velocity of the virtual mass [rad/s]."""
    side: Annotated[FloatArray, "n"]
    """(n,) sign of the torque that last drove each joint in this reaction, 0 for none."""
    tank: Cell
    """Energy taken from the push and not returned, plus the start value [J]."""
    steady: Annotated[FloatArray, 2, "n"]
    """(2, n) torque filtered once and twice, without most of its noise [Nm]."""
    sliding: Annotated[FloatArray, "n"]
    """(n,) 1 for a joint that slides against static friction, 0 for one that sticks."""
    quiet: Cell
    """Time since a torque last moved a joint [s]."""
    no_contact: Cell
    """Time since the last detected contact [s], infinite without one."""
    since: Cell
    """Time since the contact at the start of the reaction [s], infinite without one."""
    path: Annotated[FloatArray, "M", "n"]
    """(M, n) joint positions commanded on the path before the contact, newest first [rad]."""
    marked: Cell
    """Time since the newest mark [s]."""


def mass_init(n: int, params: AdmittanceParams) -> VirtualMass:
    """Return the state of n joints at rest, before the first sample."""
    mass: VirtualMass = zeros(VirtualMass, n=n, M=MARKS)
    settle(mass, params)
    return mass


def settle(mass: VirtualMass, params: AdmittanceParams) -> None:
    """Reset the reaction: the mass is at rest."""
    for part in (mass.velocity, mass.side, mass.steady, mass.sliding, mass.quiet):
        part[:] = 0.0
    mass.tank[0], mass.since[0], mass.no_contact[0] = params.start_energy_j, math.inf, math.inf


def dead_band(torque_limit: FloatArray, params: AdmittanceParams) -> FloatArray:
    """Return the external torque (n,) that moves nothing [Nm], for the joints' torque limits (n,) [Nm]."""
    return params.dead_band_nm + params.dead_band_fraction * torque_limit


@compiled
def learn_mean(mass: VirtualMass, residual: FloatArray, dt: float) -> None:
    """Add a sample (n,) of free motion to the mean.

    The second of two filters in a row contains little of a new torque: after 60 ms less than one part in a hundred.
    """
    # the mean of all samples at first, an exponential one from T / dt samples on
    mean, samples = mass.mean, mass.samples
    weight = max(1.0 - math.exp(-dt / _MEAN_S), 1.0 / (samples[0] + 1))
    samples[0] = min(samples[0] + 1, 1_000_000)
    for j in range(len(residual)):
        mean[0, j] += weight * (residual[j] - mean[0, j])
        mean[1, j] += weight * (mean[0, j] - mean[1, j])
        mass.torque[j] = residual[j] - mean[1, j]


def begin(
    mass: VirtualMass, axes: Axes, torque: FloatArray, before: FloatArray, band: FloatArray, params: AdmittanceParams
) -> None:
    """Begin a reaction at the speed that the torque (n,) [Nm] would maintain, as far as the start energy allows.

    With static friction a joint begins only where the torque measured `before` (n,) [Nm] has the same sign, and with
    the smaller of both: so noise or a small bias moves no joint, and none towards the person.
    """
    lesser, least = torque, band
    if params.static_friction_nm > 0:
        lesser = np.where(torque * before > 0, np.sign(torque) * np.minimum(np.abs(torque), np.abs(before)), 0.0)
        least = np.maximum(band, _KEEPS * params.static_friction_nm)
    drive = np.where(np.abs(lesser) > least, np.sign(lesser) * np.maximum(0.0, np.abs(lesser) - band), 0.0)
    velocity = drive / params.damping_nm_s  # where M dv/dt = d - D v is 0
    energy = 0.5 * params.inertia_kg_m2 * float(velocity @ velocity)
    if energy > params.start_energy_j:
        velocity = velocity * math.sqrt(params.start_energy_j / energy)
    velocity = velocity * min(1.0, params.speed_max_m_s / max(fastest_point(axes, velocity), _LEAST_M_S))
    settle(mass, params)
    mass.torque[:], mass.velocity[:], mass.side[:] = torque, velocity, np.sign(drive)
    mass.steady[:], mass.sliding[:], mass.since[0], mass.no_contact[0] = (torque, lesser), np.abs(mass.side), 0.0, 0.0


_MEAN_S = 0.5
"""Time constant of each of the two filters whose output is the mean torque in free motion [s]: longer than a contact's
detection, so that it contains little of one, and shorter than the drift of a bias."""
_REVERSE_BAND = 2.0
"""Factor on the dead band of a joint for torques against the last push: the rest of a released push in the estimate
must not pull the arm towards the person."""
_TANK_MAX_J = 2.0
"""Largest energy of a push in the tank [J]: that of 15 N over 0.13 m."""
_STEADY_S = 0.1
"""Time constant of each of the two filters that take the noise out of the torque [s]."""
_KEEPS = 0.85
"""Share of the static friction above which a torque keeps a joint sliding: with a bias of two thirds of it, a joint
stops and does not slide again."""
_AT_ONCE = 2.0
"""Factor on the static friction: two successive samples above it make a joint slide, independent of the filters."""
_FIRST_S = 0.3
"""Time after the onset of a contact in which two samples above `_KEEPS` do the same [s]."""
_REST_RAD_S = 1e-3
"""Speed at which an undriven joint sticks [rad/s]: invisible."""
_LEAST_M_S = 1e-12
"""Speed up to which an arm is at rest [m/s]."""


@compiled
def yield_to(
    mass: VirtualMass, residual: FloatArray, command: FloatArray, band: FloatArray, axes: Axes, p: AdmittanceParams,
    dt: float, contact: bool,
) -> None:  # fmt: skip
    """Move the virtual mass by one period dt [s] under the external torque `residual` (n,) [Nm].

    `command` (n,) is the last joint velocity command [rad/s], `band` (n,) the dead band [Nm], `axes` are the body's in
    this posture; `contact` tells that a contact is detected.
    """
    pushed, velocity = _drive(mass, residual, command, band, p, dt), mass.velocity
    velocity *= min(1.0, p.speed_max_m_s / max(fastest_point(axes, velocity), _LEAST_M_S))
    mass.quiet[0] = 0.0 if pushed else mass.quiet[0] + dt
    mass.no_contact[0] = 0.0 if contact else mass.no_contact[0] + dt
    mass.since[0] += dt


@kernel
def _drive(
    mass: VirtualMass, residual: FloatArray, command: FloatArray, band: FloatArray, p: AdmittanceParams, dt: float
) -> bool:
    """Move the mass by the torque, as far as the energy in the tank allows; return whether a push continues."""
    before, torque, velocity, side = mass.torque.copy(), mass.torque, mass.velocity, mass.side
    steady, sliding, friction, damping, n = mass.steady, mass.sliding, p.static_friction_nm, p.damping_nm_s, len(band)
    # the estimate is a low pass of the force u, y = keep y_before + (1 - keep) u; solved for u below
    keep, weight = math.exp(-dt / p.lag_s) if p.lag_s > 0.0 else 0.0, 1.0 - math.exp(-dt / _STEADY_S)
    # just after a contact the filters still lag, and the detector has found a push already
    at_once = _KEEPS if mass.since[0] < _FIRST_S else _AT_ONCE
    power, pushed, acted = 0.0, False, np.empty(n)
    for i in range(n):
        torque[i] = residual[i] - mass.mean[1, i]
        steady[0, i] += weight * (torque[i] - steady[0, i])
        steady[1, i] += weight * (steady[0, i] - steady[1, i])
        # stick and slip: two values must exceed the friction for a joint to slide; less keeps it sliding
        lasts = abs(steady[0, i]) > max(band[i], _KEEPS * friction)
        starts = _both(steady[0, i], steady[1, i], friction) or _both(torque[i], before[i], at_once * friction)
        sliding[i] = 1.0 if friction == 0.0 or starts or (sliding[i] > 0.0 and lasts) else 0.0
        pushed = pushed or (lasts and sliding[i] > 0.0)

        # the torque of the last period, by the exact inverse of the estimate's lag over one period
        acted[i] = (torque[i] - keep * before[i]) / (1.0 - keep)
        # the least energy of the push, for either torque and any error within the dead band
        power += min(torque[i] * velocity[i], acted[i] * velocity[i]) - band[i] * abs(velocity[i])
        measured, now = _beyond(torque[i], band[i]), _beyond(acted[i], band[i])
        # the smaller of both, and 0 for different signs: a force that has ended no longer drives the arm
        drive = 0.0
        if measured * now > 0.0 and sliding[i] > 0.0:
            drive = measured if abs(measured) < abs(now) else now
        # against the last push: the rest of a release in the estimate, unless well above the band
        if drive * side[i] < 0.0:
            far = min(abs(torque[i]), abs(acted[i])) > _REVERSE_BAND * band[i]
            drive = drive if far else 0.0
        # M (v' - v) / dt = d - D v', implicit: the kinetic energy grows by d v' dt at most, for any dt
        velocity[i] = (p.inertia_kg_m2 * velocity[i] + dt * drive) / (p.inertia_kg_m2 + dt * damping)
        if drive != 0.0:
            side[i] = np.sign(drive)
        # an undriven joint stops if the arm does not move it that way, or if it is nearly at rest
        elif velocity[i] * command[i] <= 0.0 or (friction > 0.0 and abs(velocity[i]) < _REST_RAD_S):
            velocity[i] = 0.0
        elif abs(velocity[i]) > abs(command[i]):
            # undriven: never faster than the command
            velocity[i] = command[i]
    # passivity observer; the cap prevents that a long push allows a long motion after it
    mass.tank[0] = min(mass.tank[0] + dt * power, _TANK_MAX_J)
    if mass.tank[0] < 0.0:
        # empty: only joints that take energy may move
        for i in range(n):
            if min(torque[i] * velocity[i], acted[i] * velocity[i]) <= band[i] * abs(velocity[i]):
                velocity[i] = 0.0
    return pushed


@kernel
def _both(one: float, other: float, level: float) -> bool:
    """Return whether both exceed a level with the same sign."""
    return one * other > 0.0 and min(abs(one), abs(other)) > level


@kernel
def _beyond(torque: float, band: float) -> float:
    """Return the part of a torque beyond the dead band, with its sign."""
    return np.sign(torque) * max(0.0, abs(torque) - band)


@compiled
def fastest_point(axes: Axes, qd: FloatArray) -> float:
    """Return the speed [m/s] of the fastest end of any capsule's axis at joint velocities `qd` (n,) [rad/s].

    The speed along an axis is convex, so no point of it is faster than both its ends.
    """
    kin, moved_by, capsules = axes
    (link, a, b, _), fastest = placed(capsules, kin), 0.0
    chain = Chain(kin.anchor, kin.axis, moved_by, qd)
    for c in range(len(link)):
        for point in (a[c], b[c]):
            x, y, z = point_velocity(chain, link[c], point[0], point[1], point[2])
            fastest = max(fastest, np.sqrt(x * x + y * y + z * z))
    return fastest


BRAKES_S = 0.2
"""Time constant of the speed near the reach [s]: from 0.3 m/s at 0.06 m before it, with 1.5 m/s^2."""
_LEAST_M = 1e-6
"""Distance up to which a displacement has no direction [m]."""


@compiled
def within_reach(axes: Axes, qd: FloatArray, origin: FloatArray, reach: float) -> tuple[FloatArray, float]:
    """Slow joint velocities (n,) [rad/s] that lead the arm too far from its start.

    The displacement is convex along an axis, so no point of it is farther away than both its ends. All joints slow by
    the same factor: none reverses, and so none turns towards the person. A motion that leads no end farther away is not
    changed.

    Args:
        axes: of the body, in this posture.
        qd: joint velocities.
        origin: (2, C, 3) ends of the axes at the start [m].
        reach: largest displacement [m].

    Returns the velocities, and the displacement of the farthest end [m].
    """
    kin, moved_by, capsules = axes
    (link, a, b, _), share, farthest = placed(capsules, kin), 1.0, 0.0
    chain = Chain(kin.anchor, kin.axis, moved_by, qd)
    for c in range(len(link)):
        for end in range(2):
            point = a[c] if end == 0 else b[c]
            away = point - origin[end, c]
            far = np.sqrt(dot(away, away))
            farthest = max(farthest, far)
            if far > _LEAST_M:
                x, y, z = point_velocity(chain, link[c], point[0], point[1], point[2])
                speed, allowed = (x * away[0] + y * away[1] + z * away[2]) / far, max(0.0, reach - far) / BRAKES_S
                if speed > allowed:
                    share = min(share, allowed / speed)
    return share * qd, farthest
