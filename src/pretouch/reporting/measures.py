"""All that a report says of one recording."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pretouch.reporting.contacts import Detection, Unanswered, detections, unanswered
from pretouch.reporting.course import Course
from pretouch.reporting.distances import Distances, distances
from pretouch.reporting.gather import gather
from pretouch.reporting.health import LoopHealth, RobotHealth, UnitHealth, loop_health, robot_health, unit_health
from pretouch.reporting.limits import JointMargin, limit_margins
from pretouch.reporting.numbers import durations
from pretouch.reporting.speeds import Speeds, speeds
from pretouch.reporting.states import States, states
from pretouch.reporting.touches import Touch, touches_of
from pretouch.types import Mode

if TYPE_CHECKING:
    from pretouch.recording.reader import Recorded


@dataclass(frozen=True)
class Measures:
    """One recording, measured."""

    title: str
    """Name of the file, with as much of its folder as tells it from the others."""
    complete: bool
    said: str
    """What is missing of a file that is not complete."""
    course: Course
    touches: tuple[Touch, ...]
    detections: tuple[Detection, ...]
    unanswered: tuple[Unanswered, ...]
    distances: Distances
    speeds: Speeds
    joints: tuple[JointMargin, ...]
    states: States
    units: tuple[UnitHealth, ...]
    robot: RobotHealth
    loop: LoopHealth

    @property
    def truth_known(self) -> bool:
        """Whether the true forces are known."""
        return self.course.truth is not None

    @property
    def duration(self) -> float:
        """How long the recording lasted [s]."""
        return float(durations(self.course.time).sum())

    @property
    def missed(self) -> tuple[Unanswered, ...]:
        """True touches that were never answered, those aside that came while the arm was yielding already."""
        return tuple(u for u in self.unanswered if u.mode is not Mode.REACT)

    @property
    def without_touch(self) -> tuple[Detection, ...]:
        """Detections without a true touch; none where the truth is not known."""
        return tuple(d for d in self.detections if d.touch is None) if self.truth_known else ()

    @property
    def peak(self) -> float | None:
        """Largest true force [N], or where it is not known the largest estimate during a contact."""
        if self.truth_known:
            return max((touch.peak for touch in self.touches), default=0.0)
        return _largest([d.peak_norm for d in self.detections])

    @property
    def held(self) -> float | None:
        """Largest force later than 0.5 s into a contact [N], from the same source as the peak; None if none lasted."""
        if self.truth_known:
            return _largest([touch.held for touch in self.touches])
        return _largest([d.held_norm for d in self.detections])

    @property
    def violations(self) -> tuple[str, ...]:
        """Limits that were exceeded, by joint."""
        return tuple(f"{name} of joint {j}" for j, joint in enumerate(self.joints, 1) for name in joint.violations)


def measure(recorded: "Recorded", title: str) -> Measures:
    """Measure a recording."""
    course = gather(recorded)
    touches = touches_of(course.truth)
    found = detections(course, touches)
    return Measures(
        title=title, complete=recorded.complete, said=recorded.said, course=course, touches=tuple(touches),
        detections=tuple(found), unanswered=tuple(unanswered(course, touches, found)), distances=distances(course),
        speeds=speeds(course), joints=tuple(limit_margins(course)), states=states(course),
        units=tuple(unit_health(course)), robot=robot_health(course), loop=loop_health(course),
    )  # fmt: skip


def _largest(values: list[float]) -> float | None:
    known = [value for value in values if np.isfinite(value)]
    return max(known, default=None)
