"""What the parts of one control step hand on to each other, and what of it may change the mode."""

from typing import NamedTuple

import numpy as np

from pretouch import faults
from pretouch.contact.announced_load import LoadState
from pretouch.contact.detector import Detection
from pretouch.desired import Desired
from pretouch.modes import Event
from pretouch.moving_fixtures import MovingFixtures
from pretouch.perception.closest import joined
from pretouch.perception.obstacles import TrackState
from pretouch.perception.outside import OutsideState
from pretouch.perception.perceive import Perception
from pretouch.profiles import Profile
from pretouch.types import Obstacles, RangeReadings, RobotState, SeenPoints, TouchReadings


class Given(NamedTuple):
    """What a step is given, as far as it can be used."""

    robot: RobotState
    events: dict[Event, str]
    watch: faults.Watch
    readings: RangeReadings
    touches: TouchReadings | None
    points: SeenPoints | None
    load: LoadState | None
    desired: Desired | None
    moving: MovingFixtures | None
    unfit: str
    """What is wrong with readings; '' for nothing."""
    lost: str
    """What is wrong with points from outside."""


class Near(NamedTuple):
    """What is near, and how well it is known."""

    seen: Perception
    tracks: TrackState
    outside: OutsideState | None
    scale: float = 1.0
    """Factor on the speed for units and outside sources that fall silent."""
    watched: bool = False
    """Whether a skin watches, all of its units heard."""
    silent: str = ""
    """Units that are silent; '' for none."""
    lost: str = ""
    """What is wrong with points of outside sources, silence included."""
    kept_off: Obstacles | None = None
    """Of what is known to move beside the arm; None where nothing is said of any."""

    @property
    def obstacles(self) -> Obstacles:
        """All that the arm is to keep off: what is seen, then what is known to move there."""
        return self.seen.obstacles if self.kept_off is None else joined(self.seen.obstacles, self.kept_off)


def events_of(unfit: str, silent: str, lost: str, detection: Detection, samples: int, p: Profile) -> dict[Event, str]:
    """Name what was seen, received and detected in one step, beside what the reaction says."""
    events: dict[Event, str] = {}
    if unfit and p.perception is not None:
        events[Event.SKIN_UNFIT] = unfit
    if silent:
        events[Event.SKIN_SILENT] = silent
    if lost:
        events[Event.POINTS_LOST] = lost
    if not detection.armed and p.detect.by_torques and bool(np.isnan(detection.residual).any()):
        events[Event.NO_FORCE] = f"up to {p.failure.force_timeout_s:g} s"
    elif not detection.armed:
        events[Event.WINDOW_FILLING] = f"{samples} of {p.window.samples} samples"
    return events
