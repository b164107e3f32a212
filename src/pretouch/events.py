"""What a step saw that may change the mode, each with the detail its sentence needs."""

import numpy as np

from pretouch.contact.detector import Detection
from pretouch.modes import Event
from pretouch.profiles import Profile


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
