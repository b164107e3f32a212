"""What must be so before an arm is moved: each check is a few lines, and says what to do if it fails."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from pretouch.checks import Checked, Fraction, NonNegative, Positive
from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.controller import Controller
from pretouch.session.standstill import Standstill
from pretouch.types import FloatArray


@dataclass(frozen=True)
class Finding:
    """One thing to know before the arm moves."""

    what: str
    """A word for programs, as `rest` or `bias`."""
    sentence: str
    refused: bool = True
    """Whether the arm is not to be moved as long as it is so."""


def refusals(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the sentences of those that forbid a run."""
    return tuple(finding.sentence for finding in findings if finding.refused)


@dataclass(frozen=True)
class PreflightParams(Checked):
    """What an arm must be like to be moved. Figures without a source are ours."""

    watch_s: Positive = 3.0
    """Time for which it is watched while it stands [s]."""
    drift_rad: Positive = 0.005
    """How far a joint may move meanwhile [rad]."""
    near_limit_rad: NonNegative = 0.1
    """Distance to a joint's limit below which it is mentioned [rad]."""
    least_room_rad: NonNegative = 0.004
    """Distance to a joint's limit below which the arm is refused [rad]: a Franka arm's set-points are followed up to
    0.003 rad before it (`LimiterParams.position_margin_rad`), and the rest is rounding. An arm between here and the
    profile's margin, where a run may end, is moved away from the limit alone."""
    bias_share: Fraction = 0.5
    """Largest mean force at rest, as a share of the base threshold F_b: 5 N of Table I's 10. Real Pandas have 0.4 to
    1.7 N an axis with nothing attached (franka_ros, issue 404)."""
    disturbance_share: Fraction = 0.5
    """Largest deviation from that mean, averaged over 0.1 s, as a share of F_b: more, and somebody touches the arm."""
    missing_share: Fraction = 0.1
    """Largest share of states without a force estimate."""
    floor_clearance_m: NonNegative = 0.05
    """Distance that the path keeps from what is below the arm [m]."""


_PLACES = 200
"""Places of the path whose height is looked at."""


def check(controller: Controller, seen: Standstill, floor: float, params: PreflightParams) -> tuple[Finding, ...]:
    """Return what there is to know of an arm that was watched, for a controller that is to move it.

    Args:
        controller: its model, path and profile count.
        seen: the arm, standing.
        floor: height of what is below it, base frame [m].
        params: limits.
    """
    return (
        *_limits(controller, seen.newest.q, params),
        *_rest(controller, seen, params),
        *_force(controller, seen, params),
        *_torques(controller, seen, params),
        *_floor(controller, floor, params),
    )


def _limits(controller: Controller, q: FloatArray, params: PreflightParams) -> Iterator[Finding]:
    model, least = controller.model, params.least_room_rad
    room = np.minimum(q - model.q_min, model.q_max - q)
    for joint in np.flatnonzero(room < max(least, params.near_limit_rad)).tolist():
        where = f"{model.joints[joint]} is at {q[joint]:.3f} rad, {room[joint]:.3f} rad from its limit"
        if room[joint] < least:
            yield Finding("limits", f"{where} (at least {least:g} rad): guide the arm away from it.")
        else:
            yield Finding("limits", f"{where}: it can hardly move in that direction.", refused=False)


def _rest(controller: Controller, seen: Standstill, params: PreflightParams) -> Iterator[Finding]:
    moved = np.ptp(seen.q, axis=0)
    joint = int(np.argmax(moved))
    if moved[joint] > params.drift_rad:
        yield Finding(
            "rest",
            f"The arm does not stand still, {controller.model.joints[joint]} moved by {moved[joint]:.3f} rad (limit"
            f" {params.drift_rad:g} rad): let it come to rest, and do not guide it.",
        )


def _force(controller: Controller, seen: Standstill, params: PreflightParams) -> Iterator[Finding]:
    threshold = thresholds_of(controller.profile.detect)
    if seen.missing_share > params.missing_share:
        yield Finding(
            "no force",
            f"The robot gives no force estimate in {100 * seen.missing_share:.0f}% of its states, because it is near a"
            " singularity: guide it to another posture.",
        )
    if seen.missing_share == 1.0:
        return
    force, most = seen.rest_wrench[:3], params.bias_share * threshold.f_base_n
    if np.abs(force).max() > most:
        yield Finding(
            "bias",
            f"At rest the robot measures a force of {_vector(force)} N (limit {most:g} N on an axis): set the mass of"
            " its hand and load, and check that nothing touches the arm.",
        )
    if seen.noise.max() > threshold.sigma_max_n:
        yield Finding(
            "noise",
            f"The force at rest has a standard deviation of {seen.noise.max():.1f} N (limit {threshold.sigma_max_n:g}"
            " N): check that nothing shakes the arm, and that its mounting is firm.",
        )
    most = params.disturbance_share * threshold.f_base_n
    if seen.disturbance > most:
        yield Finding(
            "touched",
            f"During the checks the force changed by {seen.disturbance:.1f} N (limit {most:g} N): do not touch the arm"
            " yet.",
        )


def _torques(controller: Controller, seen: Standstill, params: PreflightParams) -> Iterator[Finding]:
    profile, missing = controller.profile, float(np.mean(~np.isfinite(seen.tau_ext).all(axis=1)))
    if (profile.detect.by_torques or profile.react.by_torques) and missing > params.missing_share:
        yield Finding(
            "no torques",
            f"The robot gives no external joint torques in {100 * missing:.0f}% of its states, and the profile"
            f" {profile.name} needs them: check that its driver estimates them, or choose another profile.",
        )


def _floor(controller: Controller, floor: float, params: PreflightParams) -> Iterator[Finding]:
    path = controller.path
    lowest = min(float(path.point(phase)[2]) for phase in np.linspace(0.0, path.length, _PLACES))
    if lowest < floor + params.floor_clearance_m:
        yield Finding(
            "floor",
            f"The path comes down to z = {lowest:.2f} m, too close to the floor at {floor:.2f} m (clearance"
            f" {params.floor_clearance_m:g} m): give the real height of the floor with --floor, or choose another"
            " path.",
        )


def _vector(values: FloatArray) -> str:
    return f"({', '.join(f'{value:.1f}' for value in values)})"
