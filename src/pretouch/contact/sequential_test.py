"""Contact detection by a sequential test on the torques, which learns the arm's free motion as it goes."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch.contact.announced_load import doubted
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
    """All that the sequential test remembers."""

    test: SequentialState | None
    """None where the controller keeps it."""
    localisation: LocalisationState | None
    """None where no contact is localised."""
    touched: FloatArray
    """(M,) how long each of M touch sensors has said that it is touched, see `touch_cues` [s]."""


@dataclass(frozen=True)
class SequentialTest(SequentialParams, Detector, name="sequential"):
    """A test on the torques less their learnt mean in free motion (docs/explanation/detection.md)."""

    touch: TouchSensorParams | None = None
    """How much the units' touch sensors count; none: nothing."""
    localise: LocalisationParams | None = None
    """How the place of a contact is inferred (docs/explanation/localization.md); None: it is not."""

    State = SequentialTestState

    @property
    def reads_touch(self) -> bool:
        """Whether touch sensors count."""
        return self.touch is not None

    def init(self, body: Body, learnt: ResidualModel | None = None) -> SequentialTestState:
        """Return what is remembered before the first step."""
        test = sequential_init(body.model.n, self, learnt)
        return SequentialTestState(test, NO_CONTACT if self.localise else None, untouched(body, self.touch))

    def step(self, state: SequentialTestState, body: Body, sample: Sample) -> tuple[Detection, SequentialTestState]:
        """Hold one sample of the torques against free motion, and learn from it if nothing can be a contact."""
        location = state.localisation
        # first, for units are heard without torques too: how long a sensor has been stuck counts on
        cues, touched = touch_cues(state.touched, body, sample, self.touch)
        blind = no_torques(body, sample)
        if blind is not None:
            return blind, SequentialTestState(state.test, NO_CONTACT if location else None, touched)
        before = _test_of(state)
        if sample.doubted_kg:
            before = before._replace(model=doubted(before.model, sample.doubted_kg))
        tested, test = self._assessed(before, body, sample, cues)
        ratio, bands, significant = float(tested.log_likelihood_ratio[0]), Thresholds(*tested.bands), None
        if self.localise:
            location = localise(location or NO_CONTACT, body, sample, cues, tested, self.localise)
        if ratio >= 1.0:
            significant = most_significant_mean(tested, body.period, self.localise or _USUAL)
        detection = Detection(
            bands, strongest(tested.force, bands) if ratio >= 1.0 and sample.armed else None, sample.armed,
            tested.residual, ratio, bool(tested.lasting[0]),
            location.touched if self.localise and location else NOT_TOUCHED, significant,
            float(tested.detectable_n[0]),
        )  # fmt: skip
        return detection, SequentialTestState(test, location if self.localise else None, touched)

    def _assessed(
        self, state: SequentialState, body: Body, sample: Sample, cues: Cues
    ) -> tuple[SampleTest, SequentialState]:
        """Return what a sample says, and the state after it."""
        robot, n = sample.robot, body.model.n
        results = zeros(SampleTest, n=n, W=len(LENGTHS))
        # while a unit is touched free motion is not learnt, whatever the test says
        watched = sample.watched and not len(cues.link)
        model = ResidualModel._make(part.copy() for part in state.model)
        after = SequentialState._make((model, *(part.copy() for part in state[1:])))
        now = Moment(
            sample.kin, robot.qd, robot.qd_commanded, robot.tau_ext, sample.obstacles, cues.gain, watched,
            sample.reacting,
        )  # fmt: skip
        assess_sample(after, now, sequential_numbers(n, body.period, self), body.model.mechanism, results)
        return results, after

    def adopted(self, state: Any, body: Body, before: Detector) -> SequentialTestState:
        """Go on from another sequential test's state; touch sensors that count otherwise begin anew."""
        if not isinstance(before, SequentialTest):
            return self.init(body)
        return state if self.touch == before.touch else replace(state, touched=untouched(body, self.touch))

    def learnt(self, state: SequentialTestState) -> ResidualModel:
        """Return what was learnt of free motion."""
        return _test_of(state).model

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """Force from which one sample is a contact to an arm at its ready posture that has learnt nothing.

        By bisection; infinite where it would miss any force up to `_LARGEST_N`.
        """
        model, q, qd = body.model, body.model.description.q_ready, np.full(body.model.n, speed)
        kin, fresh, cues = model.kinematics(q), sequential_init(model.n, self), no_cues(len(model.links))
        # with the delayed velocities at the present ones nothing accelerates
        state, J = fresh._replace(model=fresh.model._replace(speed=qd)), model.ee_jacobian(kin)[:3]

        def is_detected(force: FloatArray) -> bool:
            robot = RobotState(0.0, q, qd, q, qd, J.T @ force, None)
            sample = Sample(0.0, kin, robot, window_init(2), True, no_obstacles())
            tested, _ = self._assessed(state, body, sample, cues)
            return bool(tested.log_likelihood_ratio[0] >= 1.0)

        largest = 0.0
        for axis in np.eye(3):
            if not is_detected(_LARGEST_N * axis):
                return np.inf
            low, high = 0.0, _LARGEST_N
            while high - low > _TO_N:
                middle = 0.5 * (low + high)
                low, high = (low, middle) if is_detected(middle * axis) else (middle, high)
            largest = max(largest, high)
        return largest


def _test_of(state: SequentialTestState) -> SequentialState:
    if state.test is None:
        raise ParameterError("This state lacks what the controller keeps of it: begin with init().")
    return state.test


_LARGEST_N, _TO_N = 1000.0, 0.1
"""Up to which force it is asked, and how exactly [N]."""
_USUAL = LocalisationParams()
"""Times over which torques are averaged where no contact is localised."""
