"""Contact detection by a sequential test on the torques, which learns the arm's free motion online."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch.contact.announced_load import widen_for_load
from pretouch.contact.detector import Body, Detection, Detector, Sample, no_torques, strongest
from pretouch.contact.localisation import NO_CONTACT, LocalisationState, localise, most_significant_mean
from pretouch.contact.residual_model import ResidualModel, SequentialState, sequential_init, sequential_numbers
from pretouch.contact.scatter import LENGTHS
from pretouch.contact.sequential import Moment
from pretouch.contact.sequential_step import SampleTest, assess_sample
from pretouch.contact.touch_cue import Cues, no_cues, touch_cues, untouched
from pretouch.contact.window import window_init
from pretouch.errors import ParameterError
from pretouch.params import LocalisationParams, SequentialParams, TouchSensorParams
from pretouch.records import zeros
from pretouch.types import NOT_TOUCHED, FloatArray, RobotState, Thresholds, no_obstacles
from pretouch.values import value


@value
class SequentialTestState:
    """State of the sequential test."""

    test: SequentialState | None
    """None where the controller stores it."""
    localisation: LocalisationState | None
    """None without localisation."""
    touched: FloatArray
    """(M,) time for which each of M touch sensors has reported a touch, see `touch_cues` [s]."""


@dataclass(frozen=True)
class SequentialTest(SequentialParams, Detector, name="sequential"):
    """Test of the torques less their learnt mean in free motion (docs/explanation/detection.md)."""

    touch: TouchSensorParams | None = None
    """Weight of the units' touch sensors; none: they do not count."""
    localise: LocalisationParams | None = None
    """Localisation of contacts (docs/explanation/localization.md); none: no localisation."""

    State = SequentialTestState

    def init(self, body: Body, learnt: ResidualModel | None = None) -> SequentialTestState:
        """Return the state before the first step."""
        test = sequential_init(body.model.n, self, learnt)
        return SequentialTestState(test, NO_CONTACT if self.localise else None, untouched(body, self.touch))

    def step(self, state: SequentialTestState, body: Body, sample: Sample) -> tuple[Detection, SequentialTestState]:
        """Compare one sample of the torques with free motion, and learn from it if no contact is possible."""
        location = state.localisation
        # first, and without torques too: the time of a stuck sensor counts on
        cues, touched = touch_cues(state.touched, body, sample, self.touch)
        blind = no_torques(body, sample)
        if blind is not None:
            return blind, SequentialTestState(state.test, NO_CONTACT if location else None, touched)
        before = _test_of(state)
        if sample.doubted_kg:
            before = before._replace(model=widen_for_load(before.model, sample.doubted_kg))
        tested, test = self._assess(before, body, sample, cues)
        ratio, bands, armed = float(tested.log_likelihood_ratio[0]), Thresholds(*tested.bands), sample.armed
        if self.localise:
            location = localise(location or NO_CONTACT, body, sample, cues, tested, self.localise)
        significant = most_significant_mean(tested, body.period, self.localise or _USUAL) if ratio >= 1.0 else None
        contact = strongest(tested.force, bands) if ratio >= 1.0 and armed else None
        lasting, detectable = bool(tested.lasting[0]), float(tested.detectable_n[0])
        at = location.touched if self.localise and location else NOT_TOUCHED
        detection = Detection(
            bands, contact, armed, tested.residual, ratio, ratio >= self.suspect, lasting, at, significant, detectable
        )
        return detection, SequentialTestState(test, location if self.localise else None, touched)

    def _assess(
        self, state: SequentialState, body: Body, sample: Sample, cues: Cues
    ) -> tuple[SampleTest, SequentialState]:
        """Return the test of a sample, and the state after it."""
        robot, n = sample.robot, body.model.n
        results = zeros(SampleTest, n=n, W=len(LENGTHS))
        # no learning of free motion while a unit is touched, whatever the test result
        watched = sample.watched and not len(cues.link)
        model = ResidualModel._make(part.copy() for part in state.model)
        after = SequentialState._make((model, *(part.copy() for part in state[1:])))
        motion = sample.kin, robot.qd, robot.qd_commanded, robot.tau_ext
        now = Moment(*motion, sample.obstacles, cues.gain, watched, sample.reacting)
        assess_sample(after, now, sequential_numbers(n, body.period, self), body.model.mechanism, results)
        return results, after

    def adopted(self, state: Any, body: Body, before: Detector) -> SequentialTestState:
        """Continue the state of another sequential test; touch sensors with other parameters start anew."""
        if not isinstance(before, SequentialTest):
            return self.init(body)
        return state if self.touch == before.touch else replace(state, touched=untouched(body, self.touch))

    def learnt(self, state: SequentialTestState) -> ResidualModel:
        """Return the model of free motion."""
        return _test_of(state).model

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """Return the force from which one sample is a contact, in the ready posture and before any learning.

        By bisection; infinite where the test misses any force up to `_LARGEST_N`.
        """
        model, q, qd = body.model, body.model.description.q_ready, np.full(body.model.n, speed)
        kin, fresh, cues = model.kinematics(q), sequential_init(model.n, self), no_cues(len(model.links))
        # the delayed velocities equal the present ones: no acceleration
        state, J = fresh._replace(model=fresh.model._replace(speed=qd)), model.ee_jacobian(kin)[:3]

        def is_detected(force: FloatArray) -> bool:
            robot = RobotState(0.0, q, qd, q, qd, J.T @ force, None)
            sample = Sample(0.0, kin, robot, window_init(2), True, no_obstacles())
            tested, _ = self._assess(state, body, sample, cues)
            return bool(tested.log_likelihood_ratio[0] >= 1.0)

        low, high = 0.0, 2.0 * _LARGEST_N
        while high - low > _TO_N:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if all(map(is_detected, middle * np.eye(3))) else (middle, high)
        return high if high < _LARGEST_N else np.inf


def _test_of(state: SequentialTestState) -> SequentialState:
    if state.test is None:
        raise ParameterError("This state lacks the part that the controller stores: begin with init().")
    return state.test


_LARGEST_N, _TO_N = 1000.0, 0.1
"""Largest force of the bisection, and its resolution [N]."""
_USUAL = LocalisationParams()
"""Times of the averages without localisation."""
