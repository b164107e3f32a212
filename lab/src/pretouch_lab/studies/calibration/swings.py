"""The motion of Watanabe et al.: the arm stands in many postures, and in some of them swings one joint at a time."""

import numpy as np

from pretouch.calibration.motion.limits import MotionLimits
from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.errors import ExperimentError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_POSTURES, _PER_SWINGS = 20, 10
"""In one posture of so many the joints swing, so that the motion is hardly longer than ours may be."""
_STAND_S, _SWING_S, _FADE_S = 1.0, 3.0, 1.0
_SWING_HZ = 1.0
_SWING_SPEED = 1.5
"""Fastest a swinging joint turns where the limits allow it [rad/s]; it and the frequency are the authors' program's."""
_REACH = 0.9
"""Postures are so far from the usual one at most [rad]."""
_DRAWS = 3_000
_LINE_RAD = 0.05
_SHARE = 0.99
"""Of what is allowed, for what lies between the instants that are looked at."""
_TRIAL_S = 10.0


def watanabe_plan(model: RobotModel, params: PlanParams | None = None, seed: int = 0) -> Plan:
    """Make the motion for an arm, within the same limits as our own; the seed decides the postures."""
    limits = MotionLimits(model, params or PlanParams())
    stands = _postures(limits, seed)
    knots, postures, swings = [0.0], [stands[0]], []
    for i, (q, following) in enumerate(zip(stands, [*stands[1:], stands[0]], strict=True)):
        spans = [_STAND_S]
        if i % _PER_SWINGS == 0:
            begin = knots[-1] + _STAND_S
            swings += [_swing(limits, q, joint, begin + joint * _SWING_S) for joint in range(model.n)]
            spans.append(model.n * _SWING_S)
        for span in spans:
            knots.append(knots[-1] + span)
            postures.append(q)
        knots.append(knots[-1] + _way_time(limits, q, following))
        postures.append(following)
    plan = Plan(np.array(knots), np.array(postures), tuple(swings))
    wrong = limits.broken(plan)
    if wrong:
        raise ExperimentError(f"The motion with seed {seed} cannot be made, {wrong}: try another seed.")
    return plan


def _postures(limits: MotionLimits, seed: int) -> list[FloatArray]:
    """Draw postures, each free and with a free way from the one before it, the last also to the first."""
    rng, usual = np.random.default_rng([seed, 13]), limits.model.description.q_ready
    low, high = np.maximum(usual - _REACH, limits.q_min), np.minimum(usual + _REACH, limits.q_max)
    found: list[FloatArray] = []
    for _ in range(_DRAWS):
        q = rng.uniform(low, high)
        others = found[-1:] + (found[:1] if len(found) == _POSTURES - 1 else [])
        if limits.free(q[None]).all() and all(limits.free(_line(other, q)).all() for other in others):
            found.append(q)
        if len(found) == _POSTURES:
            return found
    raise ExperimentError(
        f"Only {len(found)} of {_POSTURES} postures were found in which {limits.model.description.name} keeps clear of"
        " itself and the floor: ask for less clearance."
    )


def _line(begin: FloatArray, end: FloatArray) -> FloatArray:
    """Postures (S, n) on the straight way between two."""
    return np.linspace(begin, end, 2 + int(np.abs(end - begin).max() / _LINE_RAD))


def _way_time(limits: MotionLimits, begin: FloatArray, end: FloatArray) -> float:
    """Shortest time for the way between two postures [s]."""
    slow = Plan(np.array([0.0, _TRIAL_S]), np.array([begin, end]))
    speed, acceleration = limits.use(slow.sampled(200.0))
    return _TRIAL_S * max(speed, float(np.sqrt(acceleration))) / _SHARE


def _swing(limits: MotionLimits, q: FloatArray, joint: int, begin: float) -> Swing:
    """Swing one joint about a posture as far as its limits allow."""
    amplitude = np.zeros((1, limits.model.n))
    amplitude[0, joint] = _SWING_SPEED / (2 * np.pi * _SWING_HZ)
    frequency, phase = np.full_like(amplitude, _SWING_HZ), np.zeros_like(amplitude)
    swing = Swing(0.0, _SWING_S, _FADE_S, amplitude, frequency, phase)
    alone = Plan(np.array([0.0, _SWING_S]), np.array([q, q]), (swing,))
    fraction = min(1.0, _SHARE / max(limits.use(alone.sampled(200.0))))
    return Swing(begin, _SWING_S, _FADE_S, fraction * amplitude, frequency, phase)
