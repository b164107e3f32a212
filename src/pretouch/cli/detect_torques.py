"""`pretouch detect` on joint torques: what the profiles find, as tables, figure or page, and numbers."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch.cli.detect_account import Account
from pretouch.cli.detect_words import sentences, shown, torque_guidance
from pretouch.errors import RecordingError
from pretouch.imported_data.detect_torque import ContactEvent, ProfileResult, result_of
from pretouch.imported_data.torques import TorqueRecording
from pretouch.profiles import Profile
from pretouch.text_table import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NO = "–"
_LONGEST = 24
"""Characters of a profile's name that a table has room for."""


def torque_account(recording: TorqueRecording, profiles: Sequence[Profile]) -> Account:
    """Run profiles over a recording of torques, and give an account of what they found."""
    results = [result_of(recording, profile) for profile in profiles]
    if not any(r.by_torques or r.by_force for r in results):
        raise RecordingError(sentences(results[0].notes)[0])
    notes = sentences([*recording.notes, *(note for r in results for note in r.notes)])
    labels = _labels(results)
    pairs = list(zip(labels, results, strict=True))
    notes += [f"{label} is {r.profile.name}." for label, r in pairs if label != r.profile.name]
    tables = [_contacts(labels, results), _profiles(labels, results), *_joints(recording, labels, results)]
    rows = [_of_profile(r) for r in results]
    numbers = {
        "arm": recording.model.description.name, "joints": recording.model.joints,
        "contacts": rows[0]["contacts"], "profiles": rows,
    }  # fmt: skip
    guidance = [torque_guidance(label, r) for label, r in pairs]
    return Account(recording, notes, tables, guidance, partial(_figures, recording, labels, results), numbers)


def _labels(results: Sequence[ProfileResult]) -> list[str]:
    """Names of profiles for tables: those of long changes are numbered."""
    names = [r.profile.name for r in results]
    return [name if len(name) <= _LONGEST else f"{name.partition(':')[0]} ({k})" for k, name in enumerate(names, 1)]


def _contacts(labels: Sequence[str], results: Sequence[ProfileResult]) -> TextTable:
    pairs = zip(labels, results, strict=True)
    found = sorted(((name, c) for name, r in pairs for c in r.contacts), key=lambda pair: pair[1].time)
    rows = [_contact_row(name, c) for name, c in found] or [("none", *[""] * 9)]
    header = ("profile", "link", "time [s]", *(f"{axis} [m]" for axis in "xyz"), "force x [N]", "y", "z", "norm")
    note = (
        "Link, place and force on the robot are those where the contact stands out most, base frame; without a link the"
        " force is that at the end-effector."
    )
    return TextTable("Contacts", header, tuple(rows), note)


def _contact_row(name: str, c: ContactEvent) -> tuple[str, ...]:
    place = [shown(value, 3) for value in c.point]
    return name, c.link or _NO, f"{c.time:.3f}", *place, *(shown(v, 1) for v in (*c.force, np.linalg.norm(c.force)))


def _profiles(labels: Sequence[str], results: Sequence[ProfileResult]) -> TextTable:
    rows = []
    for name, r in zip(labels, results, strict=True):
        largest = shown(r.by_torques.largest, 2) if r.by_torques else _NO
        rows.append((
            name, str(len(r.contacts)), f"{r.duration:.1f}", f"{r.motion:.1f}", shown(r.per_hour, 1), largest,
            shown(r.detectable_n, 1),
        ))  # fmt: skip
    header = (
        "profile", "contacts", "armed [s]", "in motion [s]", "contacts an hour of motion", "evidence without contact",
        "says it finds [N]",
    )  # fmt: skip
    note = (
        "A contact is evidence from 1 on. The last is the force at the end-effector that the detector itself says it"
        " finds, in the direction the torques tell least of (median; of the paper's thresholds their distance from the"
        " mean)."
    )
    return TextTable("Detection", header, tuple(rows), note, 1)


def _joints(recording: TorqueRecording, labels: Sequence[str], results: Sequence[ProfileResult]) -> list[TextTable]:
    header = ("joint", "external torque, sigma", "residual, mean", "residual, sigma")
    note = "Outside contacts; the residual is what learnt free motion does not explain."
    tables = []
    for label, r in zip(labels, results, strict=True):
        if d := r.by_torques:
            columns = d.in_free(d.tau_ext)[1], *d.in_free(d.residual)
            rows = zip(recording.model.joints, *([shown(x, 3) for x in column] for column in columns), strict=True)
            tables.append(TextTable(f"Torques in free motion [Nm], {label}", header, tuple(rows), note, 1))
    return tables


def _figures(
    recording: TorqueRecording, labels: Sequence[str], results: Sequence[ProfileResult]
) -> list[tuple["Figure", str]]:
    from pretouch.imported_data.figures import decisions_figure, torque_figure

    title = recording.place.name
    caption = "joint torques, what free motion does not explain of them, and the evidence. Red: contacts."
    figures = [
        (torque_figure(r.by_torques, recording.model.joints, f"{title}: {name}"), f"{name}: {caption}")
        for name, r in zip(labels, results, strict=True) if r.by_torques
    ]  # fmt: skip
    if forces := [r.by_force.decisions for r in results if r.by_force]:
        caption = "Force at the end-effector by the torques, and thresholds."
        figures.append((decisions_figure(forces, title), caption))
    return figures


def _of_profile(r: ProfileResult) -> dict[str, Any]:
    numbers = {
        "profile": r.profile.name, "control_rate_hz": 1 / r.profile.task.control_period_s,
        "contacts": [_contact_numbers(c) for c in r.contacts],
        "armed_s": r.duration, "motion_s": r.motion, "contacts_in_motion": r.in_motion,
        "contacts_per_hour_of_motion": r.per_hour,
    }  # fmt: skip
    if (d := r.by_torques) is None:
        return numbers | {"threshold_width_n": r.detectable_n}
    mean, sigma = d.in_free(d.residual)
    return numbers | {
        "residual_mean_nm": mean, "residual_sigma_nm": sigma, "external_torque_sigma_nm": d.in_free(d.tau_ext)[1],
        "largest_evidence_without_contact": d.largest, "detectable_force_n": r.detectable_n,
    }  # fmt: skip


def _contact_numbers(c: ContactEvent) -> dict[str, Any]:
    known = bool(c.link)
    return {
        "time_s": c.time, "link": c.link if known else None, "point_m": c.point if known else None, "force_n": c.force,
        "norm_n": np.linalg.norm(c.force), "end_s": c.end, "probability": c.probability, "evidence": c.evidence,
    }  # fmt: skip
