"""Thresholds on a recorded force, cycle by cycle as in the controller."""

import numpy as np

from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.contact.reaction import DecayingVelocity
from pretouch.contact.window import add_force, window_init
from pretouch.errors import RecordingError
from pretouch.imported_data.forces import ForceRecording
from pretouch.imported_data.log import Note
from pretouch.imported_data.torques import pieces
from pretouch.modes import Event, mode_init, next_mode
from pretouch.profiles import Profile
from pretouch.recording.compare import Decided, Decisions
from pretouch.types import BoolArray, FloatArray, IntArray, Mode, no_obstacles
from pretouch.values import value

SLOWER = 0.95
"""Share of the detector's rate below which data count as slower."""
_BEFORE_S = 0.5
"""Time before a contact [s] that may belong to it already."""


@value
class ForceResult:
    """What thresholds decided on a force, and how they fared. Forces in N, base frame."""

    profile: Profile
    decisions: Decisions
    """Times count from the first sample."""
    duration: float
    """Time in which the detector was armed [s]."""
    free: float
    """Part of it outside contacts and reactions [s]."""
    mean: FloatArray
    """(3,) of the force in free motion, NaN without any."""
    sigma: FloatArray
    """(3,) standard deviation of the force in free motion."""
    sigma_window: FloatArray
    """(3,) median of that within the window in free motion, after eq. 8."""
    width: FloatArray
    """(3,) median distance of a threshold from the mean between both in free motion."""
    f_base_free: float
    """F_b above which the free motion would hold no contact."""
    f_base_all: float
    """F_b above which the whole recording would hold none."""
    notes: tuple[Note, ...]


def detect_force(recording: ForceRecording, profile: Profile) -> ForceResult:
    """Let a profile's thresholds run over a force at the profile's rate, the newest sample in each cycle.

    A sample is held while no other comes; after `force_timeout_s` there is none. There are no obstacles.
    Raises RecordingError for a recording too short or too slow to detect anything.
    """
    r, p = recording, profile
    if p.detect.by_torques:
        raise RecordingError(
            f"The profile {p.name} detects by joint torques, but {r.place} gives only a force: choose one with"
            " detect=thresholds."
        )
    timeout, gap, period = p.failure.force_timeout_s, float(np.median(np.diff(r.time))), p.task.control_period_s
    if gap > timeout:
        raise RecordingError(
            f"The force of {r.place} comes every {gap:.3g} s, but the detector needs it every {timeout:g} s: check the"
            " unit of the time."
        )
    # after a gap in which nothing can change any more the cycles begin anew
    decay = DecayingVelocity.of(p.react, period).decay_cycles + 2
    ticks, newest, _ = cycles(r.time, period, timeout + decay * period, hold=True)
    force = r.force[newest]
    usable = (ticks - r.time[newest] <= timeout) & (np.abs(force) < p.failure.force_max_n).all(axis=1)
    decisions = _decided(ticks, np.where(usable[:, None], force, np.nan), p)
    if not decisions.armed.any():
        raise RecordingError(
            f"{r.place} has {usable.sum() * period:.2f} s of usable force, but the window of {p.name} takes"
            f" {p.window.samples * period:g} s to fill: give a longer recording."
        )
    return _result(recording, profile, decisions)


def cycles(time: FloatArray, period: float, gap_s: float, hold: bool) -> tuple[FloatArray, IntArray, BoolArray]:
    """Instants (S,) of cycles [s], the newest sample at each, and whether it is the first of all or after a gap.

    They lie in the middle between samples, so that jitter neither doubles nor skips one. With `hold` they go on for
    the length of a gap behind the last sample before one.
    """
    phase = 0.5 * min(period, float(np.median(np.diff(time))))
    stretches = pieces(time, gap_s)
    times, first = [], []
    for piece in stretches:
        lasting = gap_s if hold and piece is not stretches[-1] else 0.0
        count = int((time[piece.stop - 1] + lasting - time[piece.start]) / period + 1e-6) + 1
        times.append(time[piece.start] + phase + period * np.arange(count))
        first.append(np.arange(count) == 0)
    ticks = np.concatenate(times)
    return ticks, np.searchsorted(time, ticks, side="right") - 1, np.concatenate(first)


def _decided(ticks: FloatArray, force: FloatArray, profile: Profile) -> Decisions:
    """Detect without obstacles; as in the controller, nothing is a contact while a reaction would be under way."""
    p, decided, nowhere, nothing = profile, Decided(profile.name), np.zeros(3), no_obstacles()
    answer, thresholds = DecayingVelocity.of(p.react, p.task.control_period_s), thresholds_of(p.detect)
    window, mode, react = window_init(p.window.samples), mode_init(), answer.init()
    for time, sample in zip(ticks.tolist(), force, strict=True):
        force_now = None if np.isnan(sample[0]) else sample
        armed, window = window.full, add_force(window, force_now, p.window)
        detection = thresholds.judged(window, force_now, armed, nowhere, nothing)
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
        react = react.advanced() if reacting else answer.init()
        compared = window.newest if force_now is not None and thresholds.compare == "filtered" else sample
        decided.add(time, sample, compared, detection.thresholds, detection.armed, reacting, contact)
    return decided.decisions()


def _result(recording: ForceRecording, profile: Profile, d: Decisions) -> ForceResult:
    """Sum decisions up."""
    period, f_base = profile.task.control_period_s, thresholds_of(profile.detect).f_base_n
    judged = d.armed & np.isfinite(d.compared).all(axis=1)
    free = judged & ~d.reacting
    for contact in d.contacts:
        free &= (d.time > contact.time) | (d.time <= contact.time - _BEFORE_S)
    beyond = np.maximum(d.compared - d.upper, d.lower - d.compared).max(axis=1)
    nothing = np.full(3, np.nan)
    some = bool(free.any())
    return ForceResult(
        profile=profile, decisions=d, duration=float(judged.sum() * period), free=float(free.sum() * period),
        mean=d.force[free].mean(axis=0) if some else nothing,
        sigma=d.force[free].std(axis=0) if some else nothing,
        sigma_window=np.median(d.sigma[free], axis=0) if some else nothing,
        width=np.median((d.upper - d.lower)[free] / 2, axis=0) if some else nothing,
        f_base_free=f_base + float(beyond[free].max()) if some else np.nan,
        f_base_all=f_base + float(beyond[judged].max()) if judged.any() else np.nan,
        notes=(*slow(recording.rate, profile), *_without(recording.time, d, profile)),
    )  # fmt: skip


def slow(rate: float, profile: Profile) -> list[Note]:
    """Say that data come at a rate [Hz] below the detector's."""
    own = 1.0 / profile.task.control_period_s
    return [Note("slower", {"profile": profile.name, "rate": rate, "own": own})] if rate < SLOWER * own else []


def _without(time: FloatArray, d: Decisions, profile: Profile) -> list[Note]:
    """Say what time is without a force."""
    timeout, steps = profile.failure.force_timeout_s, np.diff(time)
    gaps, without = steps[steps > timeout], int(np.count_nonzero(~np.isfinite(d.force).all(axis=1)))
    notes = []
    if len(gaps):
        notes.append(Note("force_gaps", {"count": len(gaps), "longer_s": timeout, "seconds": float(gaps.sum())}))
    if without:
        notes.append(Note("cycles_without", {"profile": d.name, "count": without, "of": len(d.time)}))
    return notes
