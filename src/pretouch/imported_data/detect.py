"""The detector on an imported recording, cycle by cycle as in the controller."""

import numpy as np

from pretouch.contact.decaying_velocity import DecayingVelocity, advanced
from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.contact.window import add_force, window_init
from pretouch.errors import RecordingError
from pretouch.imported_data.samples import ImportedData
from pretouch.imported_data.source import Series, newest
from pretouch.modes import Event, mode_init, next_mode
from pretouch.perception.closest import no_obstacles
from pretouch.profiles import Profile
from pretouch.recording.compare import Decided, Decisions
from pretouch.types import FloatArray, IntArray, Mode

_NOWHERE = np.zeros(3)
_NOTHING = no_obstacles()


def detect_imported(imported: ImportedData, profile: Profile) -> Decisions:
    """Let a profile's detector run over an imported recording at the profile's rate, the newest sample in each cycle.

    A sample is held while no other comes; after `force_timeout_s` there is none. There are no obstacles. Times count
    from the first sample.
    Raises RecordingError for a recording too short or too slow to detect anything.
    """
    if profile.detect.by_torques:
        raise RecordingError(
            f"The profile {profile.name} detects by joint torques, but {imported.place} gives only a force: choose one"
            " with detect=thresholds."
        )
    timeout, gap = profile.failure.force_timeout_s, float(np.median(np.diff(imported.force.time))) / 1e9
    if gap > timeout:
        raise RecordingError(
            f"The force of {imported.place} comes every {gap:.3g} s, but the detector needs it every {timeout:g} s:"
            " check the unit of the time."
        )
    ticks = _ticks(imported.force.time, profile)
    force = _forces(imported.force, ticks, profile)
    decisions = _decided(ticks, imported.force.time[0], force, profile)
    if not decisions.armed.any():
        period, usable = profile.task.control_period_s, int(np.isfinite(decisions.force[:, 0]).sum())
        raise RecordingError(
            f"{imported.place} has {usable * period:.2f} s of usable force, but the window of {profile.name} takes"
            f" {profile.window.samples * period:g} s to fill: give a longer recording."
        )
    return decisions


def _ticks(time: IntArray, profile: Profile) -> IntArray:
    """Instants of the cycles [ns], in the middle between samples, so that jitter neither doubles nor skips one.

    Gaps in which nothing can change any more are left out.
    """
    period = round(1e9 * profile.task.control_period_s)
    decay = (DecayingVelocity.of(profile.react, profile.task.control_period_s).decay_cycles + 2) * period
    lasting = round(1e9 * profile.failure.force_timeout_s) + decay
    phase = min(period, int(np.median(np.diff(time)))) // 2
    ends = np.flatnonzero(np.diff(time) > lasting)
    first = time[np.append(0, ends + 1)] - time[0]
    last = np.append(time[ends] + lasting, time[-1] + phase) - time[0] - phase
    pieces = [np.arange(-(-max(0, a - phase) // period), b // period + 1) for a, b in zip(first, last, strict=True)]
    return time[0] + phase + period * np.concatenate(pieces).astype(np.int64)


def _forces(force: Series, ticks: IntArray, profile: Profile) -> FloatArray:
    """Force (S, 3) [N] a robot would report in each cycle, NaN where it would have none."""
    at = newest(force.time, ticks)
    found = force.values[at]
    old = ticks - force.time[at] > 1e9 * profile.failure.force_timeout_s
    broken = ~np.all(np.abs(found) < profile.failure.force_max_n, axis=1)
    return np.where((old | broken)[:, None], np.nan, found)


def _decided(ticks: IntArray, begin: int, force: FloatArray, profile: Profile) -> Decisions:
    """Detect without obstacles; as in the controller, nothing is a contact while a reaction would be under way."""
    p, decided = profile, Decided(profile.name)
    answer, thresholds = DecayingVelocity.of(p.react, p.task.control_period_s), thresholds_of(p.detect)
    window, mode, react = window_init(p.window.samples), mode_init(), answer.rest()
    for time, sample in zip(((ticks - begin) / 1e9).tolist(), force, strict=True):
        force_now = None if np.isnan(sample[0]) else sample
        armed, window = window.full, add_force(window, force_now, p.window)
        detection = thresholds.judged(window, force_now, armed, _NOWHERE, _NOTHING)
        events = {Event.WINDOW_FILLING: ""} if not detection.armed else {}
        if detection.contact is not None:
            events[Event.CONTACT] = ""
        if answer.active(react):
            events[Event.REACTING] = ""
        before, mode = mode, next_mode(mode, events, resume=False)
        reacting = mode.mode is Mode.REACT
        begins = reacting and before.mode is not Mode.REACT
        contact = detection.contact if begins else None
        react = answer.begun(contact.force) if contact else react
        react = advanced(react) if reacting else answer.rest()
        compared = window.newest if force_now is not None and thresholds.compare == "filtered" else sample
        decided.add(time, sample, compared, detection.thresholds, detection.armed, reacting, contact)
    return decided.decisions()
