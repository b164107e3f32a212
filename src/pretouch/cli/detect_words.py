"""Sentences on a log of another program and on the detectors' results: one for each code."""

from collections.abc import Iterable, Sequence

import numpy as np

from pretouch.imported_data.log import Note
from pretouch.imported_data.reading import ForceRecording
from pretouch.imported_data.results import DetectorResult, ThresholdSummary
from pretouch.imported_data.torques import TorqueRecording
from pretouch.recording.compare import paired

_SENTENCES = {
    "no_time": "{rows} {have} no time and {were} left out.",
    "unused": "Columns that are not used: {names}.",
    "no_stamps": "Some headers have no stamp, so the times of recording are used.",
    "not_finite": "{samples} not finite numbers and left out.",
    "sorted": "{what}: the time went backwards {times}; the samples were sorted.",
    "repeated": "{what}: a stamp was repeated {times}; the later sample counts.",
    "no_estimate": "Force: {samples} not finite and count as no estimate.",
    "zeros_missing": "Force: {samples} all zeros and count as no estimate (--zeros kept).",
    "zeros_kept": "Force: {samples} all zeros, which on a Franka arm means no estimate (--zeros missing).",
    "looks_ee": "The force's frame_id is {frame!r}: if that is the end-effector's, add --frame ee.",
    "force_gaps": "{gaps} of more than {longer_s:g} s, {seconds:.2f} s in all, without force.",
    "gaps": "{gaps} of more than {longer_s:g} s, {seconds:.2f} s in all: what comes after begins anew.",
    "no_motion": "No joint moves: sign and unit of the velocities cannot be checked.",
    "velocities": "The velocities are {ratio:.2g} times those of the positions, with a correlation of"
    " {correlation:.2f} at the worst joint: check them.",
    "derived_velocities": "Velocities are those of positions.",
    "no_commands": "There are no commanded velocities (dq_d1_rad_s ...): the measured ones, smoothed, stand in.",
    "slower": "The data come at {rate:.4g} Hz and the detector of {profile} runs at {own:.4g} Hz: repeated samples"
    " count several times, and lower sigma; --rate {rate:.4g} runs it at the data's own rate.",
    "cycles_without": "{profile}: {count} of {of} cycles have no force, so nothing is detected in them.",
    "unwatched": "{profile}: without a skin free motion is learnt from everything that does not look like a contact"
    " (detect.learn=always), also from a touch at the start.",
    "never_armed": "{profile} was never armed: the recording is shorter than its window, or too near a singularity.",
    "long": "{profile}: the contact at {time:.1f} s lasts {seconds:.0f} s; if nobody leant on the arm, its model or"
    " load is wrong (--arm, --payload, units), or more has to be allowed for (detect.friction_prior_nm,"
    " detect.offset_prior_nm, detect.torque_prior_nm).",
    "for_currents": "{profile}: currents have gear friction in them, so more is allowed for before it is learnt:"
    " {allowed}.",
}
_TORQUES = {
    "tau_ext": "External torques",
    "tau": "Measured torques, less the model's by an observer of ours",
    "current": "Motor currents times their gains, less the model's torques by an observer of ours",
}


def sentence(note: Note) -> str:
    """Return the sentence of a note."""
    count = int(note.values.get("count", 0))
    one = count == 1
    words = {
        "rows": "1 row" if one else f"{count} rows",
        "have": "has" if one else "have",
        "were": "was" if one else "were",
        "samples": "1 sample is" if one else f"{count} samples are",
        "times": "once" if one else f"{count} times",
        "gaps": "A gap" if one else f"{count} gaps",
    }
    return _SENTENCES[note.code].format(**words | dict(note.values))


def sentences(notes: Iterable[Note]) -> list[str]:
    """Return the sentences of notes, each once."""
    return list(dict.fromkeys(map(sentence, notes)))


def read_from(r: ForceRecording | TorqueRecording) -> str:
    """Return a sentence on the data and the assumptions on it."""
    if isinstance(r, ForceRecording):
        sign, other = ("by", "on-robot") if r.by_robot else ("on", "by-robot")
        frame, another = ("end-effector's", "base") if r.in_ee else ("base", "ee")
        arm = f" The arm is assumed to be {r.model.description.name} (--arm)." if r.in_ee else ""
        return (
            f"Force from {r.source}, assumed to be the force {sign} the robot (otherwise --sign {other}) in the {frame}"
            f" frame (otherwise --frame {another}).{arm}"
        )
    torques, positions = r.sources
    sources = torques if positions == torques else f"{torques}, positions from {positions}"
    whose = ("by" if r.by_robot else "on") if r.kind == "tau_ext" else "brake" if r.by_robot else "drive"
    assumed = f"to be {whose} the robot" if r.kind == "tau_ext" else f"to {whose} the joints"
    other = "on-robot" if r.by_robot else "by-robot"
    return (
        f"{_TORQUES[r.kind]}, from {sources}, assumed {assumed} (otherwise --sign {other}). The arm is assumed to be"
        f" {r.model.description.name} (--arm)."
    )


def guidance(results: Sequence[DetectorResult]) -> list[str]:
    """Return sentences on shared contacts, and on the false alarms of an arm that nobody touched."""
    first, *others = results
    texts = []
    for r in others:
        pairs = paired(first.contacts, r.contacts)
        both = sum(a is not None and b is not None for a, b in pairs)
        texts.append(
            f"{first.profile} and {r.profile}: {both} contacts in both, {len(first.contacts) - both} only in"
            f" {first.profile}, {len(r.contacts) - both} only in {r.profile}."
        )
    for r in results:
        thresholds = r.thresholds if np.isnan(r.motion_s) else None
        texts.append(f"{r.profile}: {_threshold_guidance(r, thresholds) if thresholds else _motion_guidance(r)}")
    return texts


def _threshold_guidance(r: DetectorResult, t: ThresholdSummary) -> str:
    count, minutes = len(r.contacts), r.armed_s / 60
    if not count:
        return (
            f"no contact in {minutes:.1f} min; an F_b below {t.f_base_all_n:.1f} N would have given one (F_b is"
            f" {t.f_base_n:g} N)."
        )
    contacts, these = ("1 false contact", "this") if count == 1 else (f"{count} false contacts", "these")
    return (
        f"if nobody touched the arm, {contacts} in {minutes:.1f} min; an F_b above {t.f_base_all_n:.1f} N would have"
        f" given none, one above {t.f_base_free_n:.1f} N none but {these} (it is {t.f_base_n:g} N)."
    )


def _motion_guidance(r: DetectorResult) -> str:
    count = len(r.contacts)
    contacts = f"{count or 'no'} contact{'' if count == 1 else 's'} in {r.armed_s / 60:.1f} min"
    if not r.motion_s:
        return f"{contacts}; the arm does not move."
    return (
        f"{contacts}, {r.contacts_in_motion} of them in {r.motion_s / 60:.1f} min of motion; if nobody touched the arm,"
        f" these are {r.contacts_per_hour_of_motion:.3g} false alarms an hour."
    )


def shown(value: float, digits: int) -> str:
    """Format a number, with words for infinite and unknown ones."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "inf" if value > 0 else "–"
