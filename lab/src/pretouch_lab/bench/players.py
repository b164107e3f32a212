"""Detectors that play a recording of a real arm: each is fitted on one half of the runs, and gives flags of alarms.

A profile plays as `pretouch detect` plays it.
"""

from collections.abc import Callable
from dataclasses import field

import numpy as np

from pretouch.imported_data.detect import cycles, detect
from pretouch.imported_data.log import GAP_S
from pretouch.imported_data.results import TorqueCourse
from pretouch.imported_data.torques import TorqueRecording
from pretouch.params import TaskParams
from pretouch.profiles import profile
from pretouch.recording.compare import DetectedContact
from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value
from pretouch_lab.bench.real_sets import TorqueStream

PERIOD_S = TaskParams().control_period_s


@value
class Alarms:
    """Alarms of a detector in S cycles of a recording."""

    time: FloatArray
    """(S,) [s]."""
    alarm: BoolArray
    """(S,) true while the detector says that there is a contact."""
    stated_n: FloatArray
    """(S,) see `Detection.detectable_n` [N]; NaN where it states no force."""
    contacts: tuple[DetectedContact, ...] = field(default_factory=tuple)
    """Contacts with the links that the detector names."""


Player = Callable[[TorqueRecording], Alarms]
Method = Callable[[TorqueStream], Player]
"""Fits a detector on the runs to learn from."""


def by_profile(name: str) -> Player:
    """Return the detector of a profile, which learns online or not at all."""

    def play(recording: TorqueRecording) -> Alarms:
        _, course = detect(recording, profile(name))
        if isinstance(course, TorqueCourse):
            alarm = course.armed & (course.evidence >= 1.0)
            return Alarms(course.time, alarm, course.detectable_n, course.contacts)
        beyond = np.maximum(course.compared - course.upper, course.lower - course.compared).max(axis=1)
        return Alarms(course.time, course.judged & (beyond > 0.0), np.full(len(beyond), np.nan), course.contacts)

    return play


def sampled(recording: TorqueRecording) -> tuple[FloatArray, IntArray]:
    """Return the instants (S,) of the cycles [s] and the number of the newest sample at each."""
    time, newest, _ = cycles(recording.time, PERIOD_S, GAP_S, hold=False)
    return time, newest


def free_torques(stream: TorqueStream) -> FloatArray:
    """Return the external torques (M, n) of free motion [Nm]."""
    tau = stream.recording.tau_ext
    return tau[(stream.label == 0) & np.isfinite(tau).all(axis=1)]


def five_sigma(learn: TorqueStream) -> Player:
    """Bound each joint's external torque by five times its root mean square in the free motion to learn from."""
    bounds = 5.0 * np.sqrt((free_torques(learn) ** 2).mean(axis=0))

    def play(recording: TorqueRecording) -> Alarms:
        time, newest = sampled(recording)
        alarm = (np.abs(recording.tau_ext[newest]) > bounds).any(axis=1)  # NaN is no alarm
        return Alarms(time, alarm, np.full(len(time), np.nan))

    return play
