"""The way from posture to posture, straight in joint space, about as fast as the limits allow."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pretouch.calibration.motion.limits import RATE_HZ, MotionLimits
from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_SHORTEST_WAY_S = 0.5
"""A way takes at least this [s]."""
_LONGEST_WAY_S = 15.0
"""A way that would take longer leads to where a joint may hardly move, and is none [s]."""


@dataclass(frozen=True, eq=False)
class Route:
    """Stops, in order, and the ways between them, without swings."""

    durations: tuple[float, ...]
    """(K - 1,) of each span, dwells and ways [s]."""
    postures: FloatArray
    """(K, n) [rad]."""
    stops: Mapping[int, int]
    """Span at whose end each stop's dwell is over, by the stop's number."""

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return sum(self.durations)

    def with_swings(self, swings: Mapping[int, Swing], duration: float) -> Plan:
        """Let the arm stay for a swing at some stops, by their number, for a time each [s]."""
        after = {self.stops[stop]: swing for stop, swing in swings.items()}
        knots, postures, placed = [0.0], [self.postures[0]], []
        for span, length in enumerate(self.durations):
            knots.append(knots[-1] + length)
            postures.append(self.postures[span + 1])
            if span in after:
                placed.append(after[span].begun_at(knots[-1]))
                knots.append(knots[-1] + duration)
                postures.append(self.postures[span + 1])
        return Plan(np.array(knots), np.array(postures), tuple(placed))


class Router:
    """Finds ways from and to a start."""

    def __init__(self, limits: MotionLimits, start: FloatArray) -> None:
        """Take the start (n,) [rad]; one that the arm may not stand in is a CalibrationError."""
        n = limits.model.n
        if start.shape != (n,) or not np.all(np.isfinite(start)):
            raise CalibrationError(f"The start is {start}: give {n} finite joint positions in radians.")
        self._limits, self.start = limits, start
        trouble = limits.broken(Plan(np.array([0.0, 1.0]), np.array([start, start])))
        if trouble:
            raise CalibrationError(
                f"No motion can begin at {np.round(start, 3).tolist()} rad, because {trouble}: move the arm to where it"
                " has more space, or relax the limits."
            )

    def way(self, begin: FloatArray, end: FloatArray) -> float | None:
        """Duration of the way between two postures (n,) [s], or None where something is in it."""
        length = _SHORTEST_WAY_S
        for rough in (True, True, False):  # an envelope's part in it changes with the duration, so it takes some rounds
            rate = 20.0 / length if rough else RATE_HZ
            velocity, acceleration = self._limits.use(_straight(begin, end, length).sampled(rate))
            length = max(_SHORTEST_WAY_S, length * max(velocity, float(np.sqrt(acceleration))))
            if length > _LONGEST_WAY_S:
                return None
        length = np.ceil(1050.0 * length) / 1000.0
        return None if self._limits.broken(_straight(begin, end, length), max(10.0, 20.0 / length)) else length

    def route(self, postures: FloatArray, dwell: float) -> Route:
        """Visit all postures (S, n), nearest first, and return to the start.

        All of them can be gone to from the start; where there is something in the way between two, it leads by there.
        """
        at, left, durations, visited = self.start, list(range(len(postures))), [dwell], [self.start, self.start]
        stops: dict[int, int] = {}

        def go(to: FloatArray) -> None:
            nonlocal at
            for end in [to] if self.way(at, to) else [self.start, to]:
                durations.append(self.way(at, end) or 0.0)
                visited.append(end)
                at = end

        while left:
            stop = min(left, key=lambda i: float(np.abs(postures[i] - at).max()))
            left.remove(stop)
            go(postures[stop])
            durations.append(dwell)
            visited.append(at)
            stops[stop] = len(durations) - 1
        go(self.start)
        return Route(tuple(durations), np.array(visited), stops)


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
    length = Router(MotionLimits(model, replace(params, margin_rad=0.0)), q).way(q, plan.start)
    if length is None:
        raise CalibrationError(
            f"From {np.round(q, 3).tolist()} rad the arm cannot go straight to {np.round(plan.start, 3).tolist()} rad,"
            " where the plan begins: it would touch itself or the floor; move it there by hand."
        )
    return _straight(q, plan.start, length)


def _straight(begin: FloatArray, end: FloatArray, duration: float) -> Plan:
    return Plan(np.array([0.0, duration]), np.array([begin, end]))
