"""Choosing the motion by which units are calibrated: of many candidates those that tell most of what is known least.

The arm goes from posture to posture and stands in each for a while: the directions of gravity tell orientations, and
biases from scales. In some of them it then swings: angular velocities tell orientations again, and what the
accelerometers measure of the turning tells positions. Postures and swings are added one by one, each time the one with
which the worst known link, in its worst direction, is known best. Nothing is drawn by chance: candidates are the points
of a Sobol sequence.
"""

from dataclasses import replace
from itertools import islice

import numpy as np

from pretouch.calibration.motion.information import Observability
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
"""Length of the swings that candidates are judged by [s]."""
_POSTURES, _SWINGS = 48, 24
"""Candidates that are looked at."""
_DRAWN = 512
"""Points of the sequence among which they are sought."""
_SHRINK = 0.85
"""Factor on the amplitudes of a swing that has no room, again and again."""
_NARROWED = 0.5
"""Least factor on them by which the limits a swing breaks are met at once."""
_SMALLEST = 0.05
"""Share of its amplitudes below which a swing is given up."""
_GOAL = np.array([1e-3, 2e-3])
"""A position known to 1 mm counts as much as an orientation known to 0.11 degrees [m, rad]."""


def plan_motion(model: RobotModel, params: PlanParams = PlanParams(), start: FloatArray | None = None) -> Plan:  # noqa: B008
    """Plan a motion that makes the poses of units on all links known, from a posture and back to it.

    Args:
        model: the arm.
        params: what is asked.
        start: (n,) joint positions in which it begins [rad]; the arm's ready posture if none are given.

    Raises CalibrationError, saying what to change, where there is no such motion.
    """
    return _Planner(model, params, model.description.q_ready if start is None else start).plan()


class _Planner:
    """One search."""

    def __init__(self, model: RobotModel, params: PlanParams, start: FloatArray) -> None:
        self._model, self._params = model, params
        self._limits = MotionLimits(model, params)
        self._router = Router(self._limits, start)
        self._knowledge = Observability(model)
        self._draws = self._sequence()

    def plan(self) -> Plan:
        postures = self._postures()
        swings = [self._pattern(i, postures[i], _EXPECTED_S) for i in range(min(len(postures), _SWINGS))]
        chosen, information = self._choose_swings(postures, swings)
        standing = self._choose_standing(postures, chosen, information)
        route = self._router.route(postures[[*chosen, *standing]], self._params.dwell_s)
        patterns = dict(enumerate(chosen))
        return self._assembled(route, postures, patterns)

    def _sequence(self) -> FloatArray:
        """Points (D, 5 n) of the unit cube: for each candidate a posture, and what its swing is like."""
        from scipy.stats.qmc import Sobol  # takes a third of a second, and a plan may never be asked for

        sobol = Sobol(5 * self._model.n, scramble=False)
        sobol.fast_forward(1 + _DRAWN * self._params.variant)
        return sobol.random(_DRAWN)

    def _postures(self) -> FloatArray:
        """Postures (S, n) that keep the limits and can be gone to from the start [rad]."""
        n, limits, reach, start = self._model.n, self._limits, self._params.reach_rad, self._router.start
        low, high = np.maximum(limits.q_min, start - reach), np.minimum(limits.q_max, start + reach)
        drawn = low + (high - low) * self._draws[:, :n]
        reached = (i for i in np.flatnonzero(limits.free(drawn)) if self._router.way(start, drawn[i]))
        kept = np.array(list(islice(reached, _POSTURES)), np.int64)
        wanted = self._params.poses
        if len(kept) < wanted:
            raise CalibrationError(
                f"Of {_DRAWN} postures around the start only {len(kept)} can be reached, but {wanted} are needed: start"
                " with more space around the arm, or set a smaller clearance_m, a lower floor_m or a higher speed."
            )
        self._draws = self._draws[kept]
        return drawn[kept]

    def _pattern(self, number: int, posture: FloatArray, duration: float) -> Swing | None:
        """Make the swing of a candidate about its posture, as wide as the limits allow; None where there is no room."""
        n, p, limits = self._model.n, self._params, self._limits
        weight, phase = np.split(self._draws[number, n:].reshape(4, n), 2)
        tones = np.geomspace(p.slowest_hz, p.fastest_hz, 2 * n).reshape(2, n)
        rate = 2.0 * np.pi * tones
        room = np.minimum(limits.q_max - posture, posture - limits.q_min)
        widest = np.minimum(np.minimum(limits.qd_max / rate, limits.qdd_max / rate**2), room)
        amplitude = widest * (0.3 + 0.7 * weight)
        swing = Swing(0.0, duration, min(FADE_S, duration / 2), amplitude, tones, 2.0 * np.pi * phase)
        return self._shrunk(swing, posture)

    def _shrunk(self, swing: Swing, posture: FloatArray) -> Swing | None:
        still = np.array([posture, posture])

        def plan(factor: float) -> Plan:
            return Plan(np.array([0.0, swing.duration]), still, (swing.scaled(factor),))

        # where a wide swing touches an envelope's end it may have no speed at all, and a narrower one much
        factor = max(_NARROWED, 1.0 / max(1.0, *self._limits.use(plan(1.0).sampled(20.0))))
        while self._limits.broken(plan(factor), 20.0):
            factor *= _SHRINK
            if factor < _SMALLEST:
                return None
        return swing.scaled(factor)

    def _choose_swings(self, postures: FloatArray, swings: list[Swing | None]) -> tuple[list[int], FloatArray]:
        """Return the candidates to swing about, and what is then known (L', 23, 23)."""
        usable = [i for i, swing in enumerate(swings) if swing is not None]
        wanted = min(self._params.swings, self._params.poses)
        if len(usable) < wanted:
            raise CalibrationError(
                f"The arm can swing in only {len(usable)} of {len(swings)} postures, but {wanted} are needed: start"
                " with more space around it, or set a smaller clearance_m or margin_rad."
            )
        contributions = np.array([
            self._knowledge.of_plan(Plan(np.array([0.0, _EXPECTED_S]), postures[[i, i]], (swing,)))
            for i, swing in enumerate(swings) if swing is not None
        ])  # fmt: skip
        picked, information = self._greedy(contributions, self._knowledge.prior, wanted)
        return [usable[i] for i in picked], information

    def _choose_standing(self, postures: FloatArray, chosen: list[int], information: FloatArray) -> list[int]:
        """Return the candidates to stand in, beside those to swing about."""
        contributions = self._knowledge.of_standing(postures, self._params.dwell_s)
        information = information + contributions[chosen].sum(axis=0)
        others = [i for i in range(len(postures)) if i not in chosen]
        picked, _ = self._greedy(contributions[others], information, self._params.poses - len(chosen))
        return [others[i] for i in picked]

    def _greedy(self, contributions: FloatArray, information: FloatArray, count: int) -> tuple[list[int], FloatArray]:
        """Pick `count` of the candidates (S, L', 23, 23), one by one, by what is known with each."""
        picked: list[int] = []
        for _ in range(count):
            sigmas = np.stack(self._knowledge.sigmas(information + contributions), axis=-1) / _GOAL
            score = sigmas.max(axis=(1, 2)) + sigmas.mean(axis=(1, 2))
            score[picked] = np.inf
            picked.append(int(np.argmin(score)))
            information = information + contributions[picked[-1]]
        return picked, information

    def _assembled(self, route: Route, postures: FloatArray, patterns: dict[int, int]) -> Plan:
        """Fill the time a route leaves with swings; `patterns` are the candidates by stop."""
        left = np.floor(1000.0 * (self._params.duration_s - route.duration) / len(patterns)) / 1000.0
        if left < _SHORTEST_S:
            needed = route.duration + _SHORTEST_S * len(patterns)
            raise CalibrationError(
                f"A motion of {self._params.duration_s:g} s is too short: this one, with {self._params.poses} poses and"
                f" {len(patterns)} swings, takes {np.ceil(needed):g} s; give it that time (--duration, duration_s)."
            )
        made = {stop: self._pattern(number, postures[number], left) for stop, number in patterns.items()}
        swings = {stop: swing for stop, swing in made.items() if swing is not None}
        if len(swings) < len(made):
            raise CalibrationError(
                f"Swings of {left:g} s do not fit in {len(made) - len(swings)} of {len(made)} postures: choose another"
                " variant, or set a smaller clearance_m or margin_rad."
            )
        plan = route.with_swings(swings, left)
        trouble = self._limits.broken(plan)
        while trouble and all(swing.amplitude.max() > 0.01 for swing in plan.swings):
            plan = replace(plan, swings=tuple(swing.scaled(0.97) for swing in plan.swings))
            trouble = self._limits.broken(plan)
        if trouble:
            raise CalibrationError(f"The planned motion is not allowed ({trouble}): choose another variant.")
        return plan
