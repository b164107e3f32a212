"""The motion by which units are calibrated: postures to stand in, and a swing about each.

The directions of gravity in which the arm stands tell orientations, and biases from scales. Swings tell positions: the
accelerometers measure what turning does at a distance from the axes. The first postures with room for a swing are
taken, with nothing drawn by chance: postures and amplitudes are the points of a Sobol sequence.
"""

from dataclasses import replace

import numpy as np

from pretouch.calibration.motion.limits import PlanLimits, PlanParams
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
_DRAWN = 128
"""Points of the sequence, at most."""
_FIRST = 8
"""Those before it lie on a coarse grid, one of them at the start itself."""
_WIDTHS = 0.85 ** np.arange(19)
"""Factors on the amplitudes of a swing that are tried, one after the other, until it has room."""
_SHORTEST_WAY_S = 0.5
"""A way takes at least this [s]."""
_LONGEST_WAY_S = 15.0
"""A way that would take longer leads to where a joint may hardly move, and is none [s]."""


def plan_motion(model: RobotModel, params: PlanParams = PlanParams(), start: FloatArray | None = None) -> Plan:  # noqa: B008
    """Plan a motion that makes the poses of units on all links observable, from a posture (n,) [rad] and back to it.

    The arm's ready posture is the default start. A CalibrationError says what to change where there is no such motion.
    """
    from scipy.stats.qmc import Sobol  # takes a third of a second, and a plan may never be asked for

    limits, start = PlanLimits(model, params), model.description.q_ready if start is None else start
    _check_start(limits, start)
    sobol = Sobol(5 * model.n, scramble=False)
    sobol.fast_forward(_FIRST + _DRAWN * params.variant)
    low, high = np.maximum(limits.q_min, start - params.reach_rad), np.minimum(limits.q_max, start + params.reach_rad)
    spans, swings = [(0.0, start), (_DWELL_S, start)], list[Swing]()
    for draw in sobol.random(_DRAWN):  # a posture, and what its swing is like
        posture, at = low + (high - low) * draw[: model.n], spans[-1][1]
        if len(swings) < params.poses and _way(limits, posture, start) and (way := _way(limits, at, posture)):
            begin = sum(length for length, _ in spans) + way + _DWELL_S
            if swing := _swing(limits, posture, draw[model.n :], begin):
                spans += [(way, posture), (_DWELL_S, posture), (params.swing_s, posture)]
                swings.append(swing)
    if len(swings) < params.poses:
        raise CalibrationError(
            f"Of {_DRAWN} postures around the start only {len(swings)} can be reached and have room to swing, but"
            f" {params.poses} are needed: start with more space around the arm, or set a smaller clearance_m or"
            " margin_rad, a lower floor_m or a higher speed."
        )
    spans.append((_way(limits, spans[-1][1], start) or 0.0, start))
    lengths, postures = zip(*spans, strict=True)
    plan = Plan(np.cumsum(lengths), np.array(postures), tuple(swings))
    if trouble := limits.broken(plan):
        raise CalibrationError(f"The planned motion is not allowed ({trouble}): choose another variant.")
    return plan


def approach(model: RobotModel, q: FloatArray, goal: FloatArray, params: PlanParams) -> Plan:
    """Plan the way from where an arm stands, q (n,) [rad], to a goal (n,) [rad], straight in joint space.

    It may come as near to the joints' limits as the arm itself may; `params` give speeds, clearance and floor. Raises
    CalibrationError where something is in the way: the arm is then to be moved by hand to where nothing is.
    """
    limits = PlanLimits(model, replace(params, margin_rad=0.0))
    _check_start(limits, q)
    length = _way(limits, q, goal)
    if length is None:
        raise CalibrationError(
            f"From {np.round(q, 3).tolist()} rad the arm cannot go straight to {np.round(goal, 3).tolist()} rad,"
            " where the plan begins: it would touch itself or the floor; move it there by hand."
        )
    return _straight(q, goal, length)


def _check_start(limits: PlanLimits, start: FloatArray) -> None:
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


def _way(limits: PlanLimits, begin: FloatArray, end: FloatArray) -> float | None:
    """Duration of the way between two postures (n,) [s], or None where something is in it."""
    length = _SHORTEST_WAY_S
    for _ in range(3):  # an envelope's part in it changes with the duration, so it takes some rounds
        velocity, acceleration = limits.use(_straight(begin, end, length).sampled(20.0 / length))
        length = max(_SHORTEST_WAY_S, length * max(velocity, float(np.sqrt(acceleration))))
        if length > _LONGEST_WAY_S:
            return None
    length = np.ceil(1050.0 * length) / 1000.0
    return None if limits.broken(_straight(begin, end, length)) else length


def _swing(limits: PlanLimits, posture: FloatArray, draw: FloatArray, begin: float) -> Swing | None:
    """Make the swing about a posture, as wide as the limits allow; None where there is no room."""
    n, duration = len(posture), limits.params.swing_s
    weight, phase = np.split(draw.reshape(4, n), 2)
    tones = np.geomspace(_SLOWEST_HZ, _FASTEST_HZ, 2 * n).reshape(2, n)
    rate = 2.0 * np.pi * tones
    room = np.minimum(limits.q_max - posture, posture - limits.q_min)
    widest = np.minimum(np.minimum(limits.qd_max / rate, limits.qdd_max / rate**2), room)
    swing = Swing(0.0, duration, _FADE_S, widest * (0.3 + 0.7 * weight), tones, 2.0 * np.pi * phase)
    for factor in _WIDTHS:
        tried = replace(swing, amplitude=factor * swing.amplitude)
        if not limits.broken(Plan(np.array([0.0, duration]), np.array([posture, posture]), (tried,))):
            return replace(tried, begin=begin)
    return None
