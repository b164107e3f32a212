"""Results of detectors on recordings: numbers for tables and files, and values of each cycle for figures."""

from collections.abc import Callable, Iterable

import numpy as np

from pretouch.imported_data.log import Note
from pretouch.profiles import Profile
from pretouch.recording.compare import Decisions, DetectedContact
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

NEAR_S = 0.5
"""Time about a contact that is no free motion, and without evidence of a contact after which it is over [s]."""

AROUND_S, STILL_RAD_S = 0.3, 0.02
"""Time about an alarm that tells what a joint was doing [s], and speed up to which it is at rest [rad/s]."""


@value
class ThresholdSummary:
    """Summary of thresholds on a force, by axis; NaN without free motion. Base frame."""

    mean_n: FloatArray
    """(3,) of the force in free motion."""
    sigma_n: FloatArray
    """(3,) standard deviation of the force in free motion."""
    width_n: FloatArray
    """(3,) median distance of a threshold from the mean between both in free motion."""
    f_base_n: float
    """F_b of the profile."""
    f_base_all_n: float
    """F_b above which the whole recording would hold none."""


@value
class DetectorResult:
    """Result of a profile's detector on a recording. Times count from the first sample."""

    profile: str
    control_rate_hz: float
    contacts: tuple[DetectedContact, ...]
    armed_s: float
    """Time in which it could detect."""
    largest_evidence: float
    """Largest evidence outside contacts; NaN for thresholds."""
    detectable_n: float
    """Force at the end-effector that the detector itself says it finds: median in free motion, or median distance of a
    threshold from its mean along the worst axis; NaN if it does not say."""
    thresholds: ThresholdSummary | None
    notes: tuple[Note, ...]

    @property
    def contacts_per_hour(self) -> float:
        """All contacts by all time in which one could be detected, at rest and in motion [1/h]."""
        return 3600.0 * len(self.contacts) / self.armed_s


@value
class TorqueCourse:
    """Values of a detector on torques in S cycles."""

    time: FloatArray
    """(S,) since the first sample [s]."""
    tau_ext: FloatArray
    """(S, n) external torques [Nm]."""
    residual: FloatArray
    """(S, n) what free motion does not explain of them [Nm], NaN without torques."""
    evidence: FloatArray
    """(S,) a contact from 1 on, while armed."""
    detectable_n: FloatArray
    """(S,) force at the end-effector that the detector says it finds, see `Detection.detectable_n` [N]."""
    armed: BoolArray
    """(S,)."""
    contacts: tuple[DetectedContact, ...]

    @property
    def judged(self) -> BoolArray:
        """(S,) whether a contact could be detected."""
        return self.armed & np.isfinite(self.residual).all(axis=1)


Course = Decisions | TorqueCourse
"""Values of a detector in each cycle."""


def free_cycles(ready: BoolArray, course: Course) -> BoolArray:
    """Return which of the cycles (S,) in which a contact could be detected are not near one in time."""
    free = ready.copy()
    for c in course.contacts:
        end = c.time_s if c.end_s is None else c.end_s + NEAR_S
        free &= (course.time < c.time_s - NEAR_S) | (course.time > end)
    return free


def joint_motion(speeds: FloatArray) -> str:
    """Return what a joint is doing by its velocities (S,) in a short time [rad/s], in a word or two."""
    forwards, backwards = bool((speeds > STILL_RAD_S).any()), bool((speeds < -STILL_RAD_S).any())
    if forwards and backwards:
        return "reversing"
    if not forwards and not backwards:
        return "at rest"
    if abs(speeds[0]) <= STILL_RAD_S:
        return "setting out"
    return "stopping" if abs(speeds[-1]) <= STILL_RAD_S else "cruising"


def over(cycles: BoolArray, statistic: Callable[..., FloatArray], values: FloatArray) -> FloatArray:
    """Return a statistic of values (S, ...) over some cycles (S,), NaN over none."""
    return statistic(values[cycles], axis=0) if cycles.any() else np.full(values.shape[1:], np.nan)


def result_of(
    profile: Profile, course: Course, thresholds: ThresholdSummary | None, notes: Iterable[Note]
) -> DetectorResult:
    """Sum up a course."""
    period, evidence = profile.task.control_period_s, np.nan
    detectable = float(thresholds.width_n.max()) if thresholds else np.nan
    if isinstance(course, TorqueCourse):
        free = free_cycles(course.judged, course)
        evidence = float(over(free, np.max, course.evidence))
        detectable = float(over(free, np.median, course.detectable_n))
    armed_s, rate, contacts = float(course.judged.sum() * period), 1.0 / period, course.contacts
    return DetectorResult(profile.name, rate, contacts, armed_s, evidence, detectable, thresholds, tuple(notes))
