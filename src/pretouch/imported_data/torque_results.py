"""What each profile finds in recorded joint torques: by the torques, or by the force that they amount to."""

import numpy as np

from pretouch.composition import changed
from pretouch.errors import RecordingError
from pretouch.imported_data.detect import detect_imported
from pretouch.imported_data.events import ContactEvent
from pretouch.imported_data.samples import ImportedData
from pretouch.imported_data.source import Series
from pretouch.imported_data.summary import summary
from pretouch.imported_data.torque_detect import MOVING_RAD_S, TorqueDecisions, detect_torques, forces
from pretouch.imported_data.torque_summary import TorqueSummary, torque_summary
from pretouch.imported_data.torques import TorqueRecording
from pretouch.params import SequentialParams
from pretouch.profiles import Profile
from pretouch.recording.compare import Decisions
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

_OF_CURRENTS = {"friction_prior_nm": 0.1, "offset_prior_nm": 0.03, "torque_prior_nm": 0.02}
"""What is not known of torques by currents, as parts of the usual torque limit of a joint [1]; by the UR10e's."""
_LONG_S = 15.0
"""Time from which on a contact is doubted [s]."""
_SLOWER = 0.95
"""Share of the detector's rate below which data count as slower."""


@value
class ProfileResult:
    """What a profile finds."""

    profile: Profile
    contacts: tuple[ContactEvent, ...]
    duration: float
    """Time in which it was armed [s]."""
    motion: float
    """Part of it in which the arm moved [s]."""
    in_motion: int
    """Contacts that began in motion."""
    by_torques: tuple[TorqueDecisions, TorqueSummary] | None
    by_force: Decisions | None
    width: float
    """Median distance of a threshold of the force from its mean, along the worst axis [N]; NaN by torques."""
    notes: tuple[str, ...]

    @property
    def per_hour(self) -> float:
        """Contacts in an hour of motion: false alarms, if nobody touched the arm. NaN without motion."""
        return 3600.0 * self.in_motion / self.motion if self.motion else np.nan


def result_of(recording: TorqueRecording, profile: Profile) -> ProfileResult:
    """Let a profile's detector run over a recording; a profile that cannot run says why in its notes."""
    return _by_torques(recording, profile) if profile.detect.by_torques else _by_force(recording, profile)


def _by_torques(recording: TorqueRecording, profile: Profile) -> ProfileResult:
    profile, notes = for_currents(recording, profile)
    d = detect_torques(recording, profile)
    found = torque_summary(d, profile.task.control_period_s)
    if getattr(profile.detect, "learn", "") == "watched":
        notes.append(
            f"{profile.name}: no skin watches, so free motion is learnt from all that does not look like a contact"
            " (detect.learn=always); a touch that is there from the start is learnt too."
        )
    own = 1.0 / profile.task.control_period_s
    if recording.rate < _SLOWER * own:
        notes.append(
            f"The torques come at {recording.rate:.4g} Hz and {profile.name} runs at {own:.4g} Hz: repeated samples"
            f" look like more than they are; --rate {recording.rate:.4g} runs it at the data's own rate."
        )
    if not d.armed.any():
        notes.append(
            f"{profile.name} was never armed: the recording is shorter than its window, or too near a singularity."
        )
    if d.contacts and (longest := max(d.contacts, key=lambda c: c.end - c.time)).end - longest.time > _LONG_S:
        notes.append(
            f"{profile.name}: the contact at {longest.time:.1f} s lasts {longest.end - longest.time:.0f} s; if nobody"
            " leant on the arm, its model or load is wrong (--arm, --payload, units), or more has to be allowed for"
            " (detect.friction_prior_nm, detect.offset_prior_nm, detect.torque_prior_nm)."
        )
    return ProfileResult(
        profile, d.contacts, found.duration, found.motion, found.in_motion, (d, found), None, np.nan, tuple(notes)
    )


def for_currents(recording: TorqueRecording, profile: Profile) -> tuple[Profile, list[str]]:
    """Allow for what currents do not tell, as the friction of gears, where the profile leaves that as usual."""
    p, usual = profile.detect, SequentialParams()
    if not (recording.of_currents and isinstance(p, SequentialParams)):
        return profile, []
    large = float(np.median(recording.model.description.tau_max))
    wide = {name: share * large for name, share in _OF_CURRENTS.items()} | {"mass_prior": 0.3, "payload_prior_kg": 2.0}
    texts = {name: f"{number:.3g}" for name, number in wide.items() if getattr(p, name) == getattr(usual, name)}
    if not texts:
        return profile, []
    said = ", ".join(f"{name} = {text}" for name, text in texts.items())
    note = f"{profile.name}: currents have gear friction in them, so more is allowed for before it is learnt: {said}."
    return changed(profile, {f"detect.{name}": text for name, text in texts.items()}), [note]


def _by_force(recording: TorqueRecording, profile: Profile) -> ProfileResult:
    """Let a detector of a force run on the one that a robot's interface would make of the torques."""
    period = profile.task.control_period_s
    force, time = forces(recording, period)
    series = Series(np.round(time * 1e9).astype(np.int64), force)
    imported = ImportedData(recording.place, recording.said, series, None, None, ())
    try:
        d = detect_imported(imported, profile)
    except RecordingError as error:
        return ProfileResult(profile, (), 0.0, 0.0, 0, None, None, np.nan, (f"{profile.name} cannot run: {error}",))
    found, nowhere, at = summary(d, profile), np.full(3, np.nan), d.time + time[0]
    contacts = tuple(
        ContactEvent(c.time + time[0], c.time + time[0], "", nowhere, c.force, np.nan, np.nan) for c in d.contacts
    )
    judged = d.armed & np.isfinite(d.compared).all(axis=1)
    begins = np.array([c.time for c in contacts])
    return ProfileResult(
        profile, contacts, found.duration, float((judged & _moving(recording, at)).sum() * period),
        int(_moving(recording, begins).sum()), None, d, float(found.width.max()), (),
    )  # fmt: skip


def _moving(recording: TorqueRecording, time: FloatArray) -> BoolArray:
    """Whether the arm moves at instants (S,) [s]."""
    newest = np.searchsorted(recording.time, time, side="right") - 1
    return np.abs(recording.qd_commanded[newest]).max(axis=1) > MOVING_RAD_S
