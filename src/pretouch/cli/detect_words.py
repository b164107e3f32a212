"""Sentences on a log of another program and on the detectors' results: one for each code."""

from collections.abc import Iterable, Sequence

import numpy as np

from pretouch.imported_data.log import Note
from pretouch.imported_data.reading import ForceRecording
from pretouch.imported_data.results import DetectorResult
from pretouch.imported_data.torques import TorqueRecording

_SENTENCES = {
    "no_time": "{rows} {have} no time and {were} left out, the first at {first}.",
    "unused": "Columns that are not used: {names}.",
    "dates": "{column} holds dates: times are seconds since 1970, by UTC where no zone stands with them.",
    "cut": "The file is cut short or damaged: what can be read before that is used.",
    "fault": "A topic is not used: {reason}.",
    "no_stamps": "Some headers have no stamp, so the times of recording are used (otherwise --stamps headers).",
    "headers_back": "The stamps of the headers do not go on, so the times of recording are used (otherwise --stamps"
    " headers).",
    "pace": "The clock of the headers runs at {pace:.3g} times the pace of the recording's: the headers are used"
    " (otherwise --stamps recording).",
    "wraps": "The time began anew after {period:.9g} s {times}, first at {first}, as a clock does that is too small: it"
    " was made to go on.",
    "zeros": "{rows} {have} zeros at all joints, which is no measurement, and {were} left out, the first at {first}.",
    "repeats": "{rows} {repeat} the one before to the last digit for long, which is no measurement, and {were} left"
    " out, the first at {first}.",
    "not_finite": "{samples} not finite numbers and left out, the first at {first}.",
    "sorted": "The time went backwards {times}, first at {first}, by less than messages overtake each other; the"
    " samples were sorted.",
    "repeated": "A stamp was repeated {times}, first at {first}; the later sample counts.",
    "no_estimate": "Force: {samples} not finite and count as no estimate, the first at {first}.",
    "zeros_missing": "Force: {samples} all zeros and count as no estimate (--zeros kept), the first at {first}.",
    "zeros_kept": "Force: {samples} all zeros, the first at {first}, which on a Franka arm means no estimate (--zeros"
    " missing).",
    "looks_ee": "The force's frame_id is {frame!r}: if that is the end-effector's, add --frame ee.",
    "gaps": "{gaps} of more than {longer_s:g} s without a sample, {seconds:.2f} s in all.",
    "no_motion": "No joint moves: sign and unit of the velocities cannot be checked.",
    "velocities": "The velocities are {ratio:.2g} times those of the positions, with a correlation of"
    " {correlation:.2f} at the worst joint: check them.",
    "derived_velocities": "Velocities are those of positions.",
    "mounting": "By the torques gravity points along {gravity} in the base frame, {degrees:.0f} degrees from where the"
    " arm's description has it. It is taken so, for the model then leaves {share:.1%} of them unexplained and not"
    " {before:.0%}: give --gravity {gravity}, or write it to robot.toml.",
    "load": "By the torques the arm carries {kg:.1f} kg at its end-effector: with that the model leaves {share:.1%} of"
    " them unexplained and not {before:.0%}. Give --payload {kg:.1f}.",
    "no_commands": "There are no commanded velocities (dq_d1_rad_s ...): the measured ones, smoothed, stand in.",
    "unexplained": "The model of {arm} leaves {share:.0%} of the torques unexplained, so results may be wrong: check"
    " --arm, --payload, units and how the arm is mounted.",
    "unsure_signs": "The sign of the torques cannot be told at {names}: check it, or record more motion.",
    "slower": "The data come at {rate:.4g} Hz and the detector of {profile} runs at {own:.4g} Hz: repeated samples"
    " count several times, and lower sigma; --rate {rate:.4g} runs it at the data's own rate.",
    "deaf": "{profile} could detect nothing in {seconds:.1f} of {of:.1f} s, longest for {longest:.1f} s from"
    " {time:.1f} s on: its window was filling, or it had no usable {what}, as near a singularity or after a gap.",
    "unwatched": "{profile}: without a skin free motion is learnt from everything that does not look like a contact"
    " (detect.learn=always), also from a touch at the start.",
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
        "repeat": "repeats" if one else "repeat",
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
    """Return a sentence on each detector's false alarms on an arm that nobody touched."""
    texts = []
    for r in results:
        count, t, minutes = len(r.contacts), r.thresholds, r.armed_s / 60
        text = f"{r.profile}: {count or 'no'} contact{'s' * (count > 1)} in {minutes:.1f} min"
        if count:
            text += f"; if nobody touched the arm, {r.contacts_per_hour:.3g} false alarms an hour"
        if t is not None:
            text += f"; an F_b above {t.f_base_all_n:.1f} N gives none (it is {t.f_base_n:g} N)"
        texts.append(f"{text}.")
    return texts


def shown(value: float, digits: int) -> str:
    """Format a number, with words for infinite and unknown ones."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "inf" if value > 0 else "–"
