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

from pretouch.calibration.motion.limits import RATE_HZ, MotionLimits, PlanParams
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_DWELL_S = 1.5
"""How long the arm stands in each posture [s]."""
_SLOWEST_HZ, _FASTEST_HZ = 0.2, 1.2
"""Frequencies of the sines of a swing, no two the same [Hz]."""
_FADE_S = 1.5
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
_SHORTEST_WAY_S = 0.5
"""A way takes at least this [s]."""
_LONGEST_WAY_S = 15.0
"""A way that would take longer leads to where a joint may hardly move, and is none [s]."""


def plan_motion(model: RobotModel, params: PlanParams = PlanParams(), start: FloatArray | None = None) -> Plan:  # noqa: B008
    """Plan a motion that makes the poses of units on all links known, from a posture and back to it.

    Args:
        model: the arm.
        params: what is asked.
        start: (n,) joint positions in which it begins [rad]; the arm's ready posture if none are given.

    Raises CalibrationError, saying what to change, where there is no such motion.
    """
    from scipy.stats.qmc import Sobol  # takes a third of a second, and a plan may never be asked for

    limits, start = MotionLimits(model, params), model.description.q_ready if start is None else start
    _check_start(limits, start)
    sobol = Sobol(5 * model.n, scramble=False)
    sobol.fast_forward(_FIRST + _DRAWN * params.variant)
    draws = sobol.random(_DRAWN)  # for each candidate a posture, and what its swing is like
    low, high = np.maximum(limits.q_min, start - params.reach_rad), np.minimum(limits.q_max, start + params.reach_rad)
    postures = low + (high - low) * draws[:, : model.n]
    swung, standing = _stops(limits, start, postures, draws)
    return _with_swings(limits, _route(limits, start, postures[swung + standing]), draws[swung])


def approach(model: RobotModel, q: FloatArray, plan: Plan, params: PlanParams) -> Plan:
    """Plan the way from where an arm stands to where a plan begins, straight in joint space.

    It may come as near to the joints' limits as the arm itself may. Raises CalibrationError where something is in the
    way: the arm is then to be moved by hand to where nothing is.

    Args:
        model: the arm.
        q: (n,) where it stands [rad].
        plan: the plan to begin.
        params: speeds, clearance and floor.
    """
    limits = MotionLimits(model, replace(params, margin_rad=0.0))
    _check_start(limits, q)
    length = _way(limits, q, plan.start)
    if length is None:
        raise CalibrationError(
            f"From {np.round(q, 3).tolist()} rad the arm cannot go straight to {np.round(plan.start, 3).tolist()} rad,"
            " where the plan begins: it would touch itself or the floor; move it there by hand."
        )
    return _straight(q, plan.start, length)


def _check_start(limits: MotionLimits, start: FloatArray) -> None:
    """Refuse a posture (n,) [rad] that the arm may not stand in."""
    n = limits.model.n
    if start.shape != (n,) or not np.all(np.isfinite(start)):
        raise CalibrationError(f"The start is {start}: give {n} finite joint positions in radians.")
    if trouble := limits.broken(_straight(start, start, 1.0)):
        raise CalibrationError(
            f"No motion can begin at {np.round(start, 3).tolist()} rad, because {trouble}: move the arm to where it has"
            " more space, or relax the limits."
        )


def _straight(begin: FloatArray, end: FloatArray, duration: float) -> Plan:
    return Plan(np.array([0.0, duration]), np.array([begin, end]))


def _way(limits: MotionLimits, begin: FloatArray, end: FloatArray) -> float | None:
    """Duration of the way between two postures (n,) [s], or None where something is in it."""
    length = _SHORTEST_WAY_S
    for rough in (True, True, False):  # an envelope's part in it changes with the duration, so it takes some rounds
        rate = 20.0 / length if rough else RATE_HZ
        velocity, acceleration = limits.use(_straight(begin, end, length).sampled(rate))
        length = max(_SHORTEST_WAY_S, length * max(velocity, float(np.sqrt(acceleration))))
        if length > _LONGEST_WAY_S:
            return None
    length = np.ceil(1050.0 * length) / 1000.0
    return None if limits.broken(_straight(begin, end, length), max(10.0, 20.0 / length)) else length


def _stops(
    limits: MotionLimits, start: FloatArray, postures: FloatArray, draws: FloatArray
) -> tuple[list[int], list[int]]:
    """Return the first candidates that can be gone to: those to swing about, and those only to stand in."""
    params = limits.params
    swings = min(params.swings, params.poses)
    swung, standing = list[int](), list[int]()
    for i in np.flatnonzero(limits.free(postures)).tolist():
        if len(swung) == swings and len(standing) == params.poses - swings:
            return swung, standing
        if not _way(limits, start, postures[i]):
            continue
        if len(swung) < swings and _swing(limits, postures[i], draws[i], _EXPECTED_S) is not None:
            swung.append(i)
        elif len(standing) < params.poses - swings:
            standing.append(i)
    raise CalibrationError(
        f"Of {len(draws)} postures around the start only {len(swung) + len(standing)} can be reached, {len(swung)} of"
        f" them with room to swing, but {params.poses} are needed, {swings} with room: start with more space around the"
        " arm, or set a smaller clearance_m or margin_rad, a lower floor_m or a higher speed."
    )


def _route(limits: MotionLimits, start: FloatArray, postures: FloatArray) -> list[tuple[float, FloatArray, int | None]]:
    """Visit all postures (S, n), nearest first, and return to the start; stand a while at the start and in each.

    All of them can be gone to from the start; where there is something in the way between two, it leads by there.
    Returned are the spans: how long each takes [s], where it ends, and which posture the arm has stood in then.
    """
    at, left = start, list(range(len(postures)))
    spans: list[tuple[float, FloatArray, int | None]] = [(_DWELL_S, start, None)]
    while left or at is not start:
        stop = min(left, key=lambda i: float(np.abs(postures[i] - at).max())) if left else None
        to = start if stop is None else postures[stop]
        for end in [to] if _way(limits, at, to) else [start, to]:
            spans.append((_way(limits, at, end) or 0.0, end, None))
            at = end
        if stop is not None:
            left.remove(stop)
            spans.append((_DWELL_S, at, stop))
    return spans


def _swing(limits: MotionLimits, posture: FloatArray, draw: FloatArray, duration: float) -> Swing | None:
    """Make the swing about a posture, as wide as the limits allow; None where there is no room."""
    n = len(posture)
    weight, phase = np.split(draw[n:].reshape(4, n), 2)
    tones = np.geomspace(_SLOWEST_HZ, _FASTEST_HZ, 2 * n).reshape(2, n)
    rate = 2.0 * np.pi * tones
    room = np.minimum(limits.q_max - posture, posture - limits.q_min)
    widest = np.minimum(np.minimum(limits.qd_max / rate, limits.qdd_max / rate**2), room)
    amplitude = widest * (0.3 + 0.7 * weight)
    swing = Swing(0.0, duration, min(_FADE_S, duration / 2), amplitude, tones, 2.0 * np.pi * phase)
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


def _with_swings(limits: MotionLimits, spans: list[tuple[float, FloatArray, int | None]], draws: FloatArray) -> Plan:
    """Fill the time a route leaves with a swing for each of the draws, about the first postures."""
    params, count, route = limits.params, len(draws), sum(length for length, _, _ in spans)
    left = np.floor(1000.0 * (params.duration_s - route) / count) / 1000.0
    if left < _SHORTEST_S:
        raise CalibrationError(
            f"A motion of {params.duration_s:g} s is too short: this one, with {params.poses} poses and {count} swings,"
            f" takes {np.ceil(route + _SHORTEST_S * count):g} s; give it that time (--duration-s)."
        )
    knots, postures, swings = [0.0], [spans[0][1]], list[Swing]()
    for length, end, stop in spans:
        knots.append(knots[-1] + length)
        postures.append(end)
        if stop is not None and stop < count:
            swing = _swing(limits, end, draws[stop], left)
            if swing is None:
                raise CalibrationError(
                    f"A swing of {left:g} s does not fit about one of the postures: choose another variant, or set a"
                    " smaller clearance_m or margin_rad."
                )
            swings.append(replace(swing, begin=knots[-1]))
            knots.append(knots[-1] + left)
            postures.append(end)
    plan = Plan(np.array(knots), np.array(postures), tuple(swings))
    trouble = limits.broken(plan)
    while trouble and all(swing.amplitude.max() > 0.01 for swing in plan.swings):
        plan = replace(plan, swings=tuple(swing.scaled(0.97) for swing in plan.swings))
        trouble = limits.broken(plan)
    if trouble:
        raise CalibrationError(f"The planned motion is not allowed ({trouble}): choose another variant.")
    return plan
