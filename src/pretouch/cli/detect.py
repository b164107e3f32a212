"""What `pretouch detect` does: the detector of some profiles on a recording of any arm, as tables, figure and file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from pretouch.cli.detect_drawing import ENDINGS, write_drawing
from pretouch.cli.detect_torques import show_torques
from pretouch.cli.detect_words import force_guidance, read_from, sentences
from pretouch.cli.tables import Grid
from pretouch.cli.words import words
from pretouch.cli.writing import check_writable, numbers_to
from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.errors import ParameterError, RecordingError
from pretouch.extras import FIGURES
from pretouch.imported_data.detect_force import ForceResult, detect_force
from pretouch.imported_data.forces import ForceRecording, read_force
from pretouch.imported_data.log import TORQUES, Choice, LogFile
from pretouch.imported_data.reading import open_log
from pretouch.imported_data.torques import torque_recording
from pretouch.profiles import Profile, at_rate
from pretouch.profiles import profile as find_profile
from pretouch.recording.compare import Found, matched
from pretouch.text_table import TextTable


def detect(
    place: Path,
    choice: Choice,
    profiles: Sequence[str] | None = None,
    rate: float = 0.0,
    out: Path | None = None,
    json_file: Path | None = None,
) -> None:
    """Run detectors over a recording, show what they found, and write a figure and the numbers where asked.

    Args:
        place: bag, MCAP or CSV file.
        choice: what the recording does not say of itself.
        profiles: names of the profiles to compare; None: `pretouch` and `paper` where there are joint torques, else
            `paper`.
        rate: of the detector [Hz]; 0 for the profile's own.
        out: figure to write, or page.
        json_file: file for the numbers.
    """
    given = None if profiles is None else [_profile(name, rate) for name in profiles]
    if given is not None and not given:
        raise ParameterError("No profile is given: name one or more, separated by commas.")
    if out and out.suffix not in ENDINGS:
        raise RecordingError(f"The figure {out} has an unknown format: use one of the endings {', '.join(ENDINGS)}.")
    if out:
        FIGURES.need("A figure")
        check_writable("figure", out)
    with numbers_to(json_file) as write:
        file, unused = open_log(place, choice), ""
        if _by_torques(file, choice, given):
            try:
                recording = torque_recording(file.torques(), choice)
            except RecordingError as error:
                if given is not None or "force" not in file.kinds:
                    raise
                unused = f"Joint torques are not used: {error}"
            else:
                show_torques(recording, given or [_profile(name, rate) for name in ("pretouch", "paper")], out, write)
                return
        force = read_force(file, choice)
        results = [detect_force(force, profile) for profile in given or [_profile("paper", rate)]]
        notes = sentences([*force.notes, *(note for r in results for note in r.notes)])
        notes = [*([unused] if unused else []), *notes]
        if any(r.profile.perception is not None and thresholds_of(r.profile.detect).f_d_n for r in results):
            notes.append("Without a skin no obstacle is known, so eq. 11 lowers no threshold.")
        if out:
            _draw(force, results, notes, out)
        write(_numbers(force, results, notes))
        _show(force, results, notes)
        if out:
            print(f"{'Page' if out.suffix == '.html' else 'Figure'}: {out}")


def gains_of(text: str) -> tuple[float, ...]:
    """Read the gains of motors [Nm/A]; ParameterError for what is no list of numbers above zero."""
    try:
        gains = tuple(float(word) for word in words(text))
    except ValueError:
        gains = (0.0,)
    if not all(np.isfinite(gain) and gain > 0.0 for gain in gains):
        raise ParameterError(f"--gains is {text!r}: give torques by current [Nm/A], one a joint, separated by commas.")
    return gains


def _by_torques(file: LogFile, choice: Choice, given: Sequence[Profile] | None) -> bool:
    """Whether the detectors run on joint torques: where there are some, unless only thresholds of a force are asked."""
    if choice.frame == "ee":
        return False
    if choice.torques or choice.gains or choice.payload_kg:
        return True
    force, torques = "force" in file.kinds, bool(set(TORQUES) & file.kinds)
    if choice.wrench or (force and given is not None and not any(p.detect.by_torques for p in given)):
        return False
    return torques or ("q" in file.kinds and not force)


def _draw(force: ForceRecording, results: list[ForceResult], notes: list[str], out: Path) -> None:
    from pretouch.imported_data.figures import decisions_figure

    title, (contacts, noise) = force.place.name, (_contacts(results), _noise_table(results))
    tables = [
        TextTable("Contacts, force on the robot [N]", tuple(contacts.header), tuple(map(tuple, contacts.rows)), "", 1),
        TextTable("Free motion [N]", tuple(noise.header), tuple(map(tuple, noise.rows)), "", 1),
    ]
    said = [*map(force_guidance, results), read_from(force), *notes]
    caption = "Force along each axis between its thresholds, and contacts."
    write_drawing(title, said, tables, [(decisions_figure([r.decisions for r in results], title), caption)], out)


def _profile(name: str, rate: float) -> Profile:
    return at_rate(find_profile(name), rate) if rate else find_profile(name)


def _show(force: ForceRecording, results: list[ForceResult], notes: list[str]) -> None:
    console = Console(highlight=False, soft_wrap=True)
    console.print(
        f"{force.place}: {len(force.time)} samples in {force.time[-1]:.1f} s, {force.rate:.4g} Hz, the first at"
        f" {force.first_s:.3f} s: times below count from it.",
        markup=False,
    )
    console.print(read_from(force), markup=False)
    for note in notes:
        console.print(note, markup=False)
    console.print("\nContacts, force on the robot [N]", style="bold", markup=False)
    console.print(_contacts(results))
    first, *others = (r.decisions for r in results)
    for d in others:
        both, only_first, only_other = matched(first.contacts, d.contacts)
        console.print(
            f"{first.name} and {d.name}: {len(both)} contacts in both, {len(only_first)} only in {first.name},"
            f" {len(only_other)} only in {d.name}.",
            markup=False,
        )
    console.print("\nFree motion [N]", style="bold", markup=False)
    console.print(_noise_table(results))
    console.print()
    for result in results:
        console.print(force_guidance(result), markup=False)


def _contacts(results: list[ForceResult]) -> Grid:
    return contact_table([(r.decisions.name, contact) for r in results for contact in r.decisions.contacts])


def contact_table(contacts: Sequence[tuple[str, Found]]) -> Grid:
    """Make a table of contacts, each with who found it, in time order."""
    rows = []
    for name, found in sorted(contacts, key=lambda pair: pair[1].time):
        force = [f"{value:.1f}" for value in (*found.force, np.linalg.norm(found.force))]
        rows.append((name, f"{found.time:.3f}", *force, axes_shown(found)))
    return Grid(("", "time [s]", "x", "y", "z", "norm", "axes"), rows or [("none", *[""] * 6)])


def axes_shown(found: Found) -> str:
    """Name the axes whose threshold a contact crossed."""
    return "".join(axis for axis, crossed in zip("xyz", found.axes, strict=True) if crossed)


def _noise_table(results: list[ForceResult]) -> Grid:
    rows = []
    for s in results:
        name = f"{s.decisions.name}, {s.free:.1f} of {s.duration:.1f} s"
        for axis, *values in zip("xyz", s.mean, s.sigma, s.sigma_window, s.width, strict=True):
            rows.append((name if axis == "x" else "", axis, *(f"{value:.2f}" for value in values)))
    return Grid(("", "along", "mean", "sigma", "sigma in window", "thresholds at +-"), rows)


def _numbers(force: ForceRecording, results: list[ForceResult], notes: list[str]) -> dict[str, Any]:
    return {
        "recording": str(force.place), "assumed": read_from(force), "notes": notes, "samples": len(force.time),
        "first_sample_s": force.first_s, "duration_s": force.time[-1], "rate_hz": force.rate,
        "profiles": [
            {
                "profile": r.decisions.name, "control_rate_hz": 1 / r.profile.task.control_period_s,
                "contacts": [
                    {"time_s": c.time, "force_n": c.force, "norm_n": np.linalg.norm(c.force), "axes": axes_shown(c)}
                    for c in r.decisions.contacts
                ],
                "armed_s": r.duration, "free_s": r.free, "free_mean_n": r.mean, "free_sigma_n": r.sigma,
                "free_window_sigma_n": r.sigma_window,
                "threshold_width_n": r.width, "f_base_no_contact_free_n": r.f_base_free,
                "f_base_no_contact_n": r.f_base_all,
            }
            for r in results
        ],
    }  # fmt: skip
