"""The motion by which units are calibrated: postures to stand in, and swings about some of them.

The directions of gravity in which the arm stands tell orientations, and biases from scales. Swings tell positions: the
accelerometers measure what turning does at a distance from the axes. The first postures and swings that keep the limits
are taken, with nothing drawn by chance: postures and amplitudes are the points of a Sobol sequence.

Until commit f3f03881 a search took those that tell most. On Panda and FR3, three variants each, what is taken here
leaves a unit's position uncertain by 1.0 to 1.4 times as much, and its orientation by 1.0 to 1.9 times, both below
0.7 mm and 0.011 degrees.
"""

from dataclasses import replace

import numpy as np

from pretouch.calibration.motion.limits import MotionLimits
from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.calibration.motion.route import Route, Router
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

FADE_S = 1.5
"""Time a swing takes to fade in, and out [s]."""
_SHORTEST_S = 5.0
"""Shortest swing [s]."""
_EXPECTED_S = 10.0
"""Length of the swings that postures are tried with [s]."""
_DRAWN = 512
"""Points of the sequence, at most."""
_FIRST = 8
"""Those before it lie on a coarse grid, one of them at the start itself."""
_SHRINK = 0.85
"""Factor on the amplitudes of a swing that has no room, again and again."""
_NARROWED = 0.5
"""Least factor on them by which the limits a swing breaks are met at once."""
_SMALLEST = 0.05
"""Share of its amplitudes below which a swing is given up."""


def plan_motion(model: RobotModel, params: PlanParams = PlanParams(), start: FloatArray | None = None) -> Plan:  # noqa: B008
    """Plan a motion that makes the poses of units on all links known, from a posture and back to it.

    Args:
        model: the arm.
        params: what is asked.
        start: (n,) joint positions in which it begins [rad]; the arm's ready posture if none are given.

    Raises CalibrationError, saying what to change, where there is no such motion.
    """
    limits = MotionLimits(model, params)
    router = Router(limits, model.description.q_ready if start is None else start)
    draws = _sequence(model.n, params.variant)
    swung, standing = _stops(limits, router, params, draws)
    order = [*swung, *standing]
    postures = _postures(limits, router.start, params, draws)[order]
    return _with_swings(limits, params, router.route(postures, params.dwell_s), postures, draws[swung])


def _sequence(n: int, variant: int) -> FloatArray:
    """Points (D, 5 n) of the unit cube: for each candidate a posture, and what its swing is like."""
    from scipy.stats.qmc import Sobol  # takes a third of a second, and a plan may never be asked for

    sobol = Sobol(5 * n, scramble=False)
    sobol.fast_forward(_FIRST + _DRAWN * variant)
    return sobol.random(_DRAWN)


def _postures(limits: MotionLimits, start: FloatArray, params: PlanParams, draws: FloatArray) -> FloatArray:
    """Postures (D, n) about the start [rad]."""
    low, high = np.maximum(limits.q_min, start - params.reach_rad), np.minimum(limits.q_max, start + params.reach_rad)
    return low + (high - low) * draws[:, : len(start)]


def _stops(limits: MotionLimits, router: Router, params: PlanParams, draws: FloatArray) -> tuple[list[int], list[int]]:
    """Return the first candidates that can be gone to: those to swing about, and those only to stand in."""
    postures = _postures(limits, router.start, params, draws)
    swings = min(params.swings, params.poses)
    swung, standing = list[int](), list[int]()
    for i in np.flatnonzero(limits.free(postures)).tolist():
        if len(swung) == swings and len(standing) == params.poses - swings:
            return swung, standing
        if not router.way(router.start, postures[i]):
            continue
        if len(swung) < swings and _swing(limits, params, postures[i], draws[i], _EXPECTED_S) is not None:
            swung.append(i)
        elif len(standing) < params.poses - swings:
            standing.append(i)
    raise CalibrationError(
        f"Of {len(draws)} postures around the start only {len(swung) + len(standing)} can be reached, {len(swung)} of"
        f" them with room to swing, but {params.poses} are needed, {swings} with room: start with more space around the"
        " arm, or set a smaller clearance_m or margin_rad, a lower floor_m or a higher speed."
    )


def _swing(
    limits: MotionLimits, params: PlanParams, posture: FloatArray, draw: FloatArray, duration: float
) -> Swing | None:
    """Make the swing about a posture, as wide as the limits allow; None where there is no room."""
    n = len(posture)
    weight, phase = np.split(draw[n:].reshape(4, n), 2)
    tones = np.geomspace(params.slowest_hz, params.fastest_hz, 2 * n).reshape(2, n)
    rate = 2.0 * np.pi * tones
    room = np.minimum(limits.q_max - posture, posture - limits.q_min)
    widest = np.minimum(np.minimum(limits.qd_max / rate, limits.qdd_max / rate**2), room)
    amplitude = widest * (0.3 + 0.7 * weight)
    swing = Swing(0.0, duration, min(FADE_S, duration / 2), amplitude, tones, 2.0 * np.pi * phase)
    still = np.array([posture, posture])

    def plan(factor: float) -> Plan:
        return Plan(np.array([0.0, duration]), still, (swing.scaled(factor),))

    # where a wide swing touches an envelope's end it may have no speed at all, and a narrower one much
    factor = max(_NARROWED, 1.0 / max(1.0, *limits.use(plan(1.0).sampled(20.0))))
    while limits.broken(plan(factor), 20.0):
        factor *= _SHRINK
        if factor < _SMALLEST:
            return None
    return swing.scaled(factor)


def _with_swings(
    limits: MotionLimits, params: PlanParams, route: Route, postures: FloatArray, draws: FloatArray
) -> Plan:
    """Fill the time a route leaves with a swing for each of the draws, about the first postures."""
    left = np.floor(1000.0 * (params.duration_s - route.duration) / len(draws)) / 1000.0
    if left < _SHORTEST_S:
        needed = route.duration + _SHORTEST_S * len(draws)
        raise CalibrationError(
            f"A motion of {params.duration_s:g} s is too short: this one, with {params.poses} poses and"
            f" {len(draws)} swings, takes {np.ceil(needed):g} s; give it that time (--duration, duration_s)."
        )
    tried = [_swing(limits, params, postures[i], draw, left) for i, draw in enumerate(draws)]
    swings = {i: swing for i, swing in enumerate(tried) if swing is not None}
    if len(swings) < len(tried):
        raise CalibrationError(
            f"Swings of {left:g} s do not fit in {len(tried) - len(swings)} of {len(tried)} postures: choose another"
            " variant, or set a smaller clearance_m or margin_rad."
        )
    plan = route.with_swings(swings, left)
    trouble = limits.broken(plan)
    while trouble and all(swing.amplitude.max() > 0.01 for swing in plan.swings):
        plan = replace(plan, swings=tuple(swing.scaled(0.97) for swing in plan.swings))
        trouble = limits.broken(plan)
    if trouble:
        raise CalibrationError(f"The planned motion is not allowed ({trouble}): choose another variant.")
    return plan
