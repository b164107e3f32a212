"""What `pretouch detect` does: the detector of some profiles on a recording of any arm, as tables, figure and file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from pretouch.cli.detect_drawing import ENDINGS, write_drawing
from pretouch.cli.detect_torques import show_torques
from pretouch.cli.tables import Grid
from pretouch.cli.words import words
from pretouch.cli.writing import check_writable, numbers_to
from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.errors import ParameterError, RecordingError
from pretouch.extras import FIGURES
from pretouch.imported_data.detect import detect_imported
from pretouch.imported_data.held import holds_force, holds_torques
from pretouch.imported_data.samples import ImportedData, read_imported
from pretouch.imported_data.source import Choice
from pretouch.imported_data.summary import Summary, findings, guidance, summary
from pretouch.imported_data.torques import read_torques
from pretouch.profiles import Profile, at_rate
from pretouch.profiles import profile as find_profile
from pretouch.recording.compare import Decisions, Found, matched
from pretouch.text_table import TextTable

Column = tuple[Profile, Decisions, Summary]


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
        unused: tuple[str, ...] = ()
        if choice.frame == "base" and _torques_wanted(place, choice, given):
            try:
                recording = read_torques(place, choice)
            except RecordingError as error:
                if given is not None or not holds_force(place, choice):
                    raise
                unused = (f"Joint torques are not used: {error}",)
            else:
                show_torques(recording, given or [_profile(name, rate) for name in ("pretouch", "paper")], out, write)
                return
        used = given or [_profile("paper", rate)]
        imported = read_imported(place, choice)
        columns = [(p, d, summary(d, p)) for p in used for d in [detect_imported(imported, p)]]
        notes = list(dict.fromkeys([*unused, *imported.notes, *_said(imported, columns)]))
        if out:
            _draw(imported, columns, notes, out)
        write(_numbers(imported, columns, notes))
        _show(imported, columns, notes)
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


def _torques_wanted(place: Path, choice: Choice, given: Sequence[Profile] | None) -> bool:
    """Whether the detectors run on joint torques: where there are some, unless only thresholds of a force are asked."""
    asked = bool(choice.torques or choice.gains or choice.payload_kg)
    if choice.wrench and not asked:
        return False
    if given is not None and not asked and not any(p.detect.by_torques for p in given):
        return not holds_force(place, choice) and holds_torques(place, choice)
    return asked or holds_torques(place, choice)


def _draw(imported: ImportedData, columns: list[Column], notes: list[str], out: Path) -> None:
    from pretouch.imported_data.figure import decisions_figure

    title, (contacts, noise) = imported.place.name, (_contacts(columns), _noise_table(columns))
    tables = [
        TextTable("Contacts, force on the robot [N]", tuple(contacts.header), tuple(map(tuple, contacts.rows)), "", 1),
        TextTable("Free motion [N]", tuple(noise.header), tuple(map(tuple, noise.rows)), "", 1),
    ]
    said = [*(guidance(d, found, p) for p, d, found in columns), imported.said, *notes]
    shown = "Force along each axis between its thresholds, and contacts."
    write_drawing(title, said, tables, [(decisions_figure([d for _, d, _ in columns], title), shown)], out)


def _profile(name: str, rate: float) -> Profile:
    return at_rate(find_profile(name), rate) if rate else find_profile(name)


def _said(imported: ImportedData, columns: list[Column]) -> list[str]:
    said = [sentence for p, d, _ in columns for sentence in findings(imported, d, p)]
    if any(p.perception is not None and thresholds_of(p.detect).f_d_n for p, _, _ in columns):
        said.append("Without a skin no obstacle is known, so eq. 11 lowers no threshold.")
    return said


def _show(imported: ImportedData, columns: list[Column], notes: list[str]) -> None:
    console = Console(highlight=False, soft_wrap=True)
    time = imported.force.time
    seconds = (time[-1] - time[0]) / 1e9
    console.print(
        f"{imported.place}: {len(time)} samples in {seconds:.1f} s, {imported.rate:.4g} Hz, the first at"
        f" {time[0] / 1e9:.3f} s: times below count from it.",
        markup=False,
    )
    console.print(imported.said, markup=False)
    for note in notes:
        console.print(note, markup=False)
    console.print("\nContacts, force on the robot [N]", style="bold", markup=False)
    console.print(_contacts(columns))
    first = columns[0][1]
    for _, d, _ in columns[1:]:
        both, only_first, only_other = matched(first.contacts, d.contacts)
        console.print(
            f"{first.name} and {d.name}: {len(both)} contacts in both, {len(only_first)} only in {first.name},"
            f" {len(only_other)} only in {d.name}.",
            markup=False,
        )
    console.print("\nFree motion [N]", style="bold", markup=False)
    console.print(_noise_table(columns))
    console.print()
    for p, d, found in columns:
        console.print(guidance(d, found, p), markup=False)


def _contacts(columns: list[Column]) -> Grid:
    return contact_table([(d.name, found) for _, d, _ in columns for found in d.contacts])


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


def _noise_table(columns: list[Column]) -> Grid:
    rows = []
    for _, d, s in columns:
        name = f"{d.name}, {s.free:.1f} of {s.duration:.1f} s"
        for axis, *values in zip("xyz", s.mean, s.sigma, s.sigma_window, s.width, strict=True):
            rows.append((name if axis == "x" else "", axis, *(f"{value:.2f}" for value in values)))
    return Grid(("", "along", "mean", "sigma", "sigma in window", "thresholds at +-"), rows)


def _numbers(imported: ImportedData, columns: list[Column], notes: list[str]) -> dict[str, Any]:
    time = imported.force.time
    return {
        "recording": str(imported.place), "assumed": imported.said, "notes": notes, "samples": len(time),
        "first_sample_s": time[0] / 1e9,
        "duration_s": (time[-1] - time[0]) / 1e9, "rate_hz": imported.rate,
        "profiles": [
            {
                "profile": d.name, "control_rate_hz": 1 / p.task.control_period_s,
                "contacts": [
                    {"time_s": c.time, "force_n": c.force, "norm_n": np.linalg.norm(c.force), "axes": axes_shown(c)}
                    for c in d.contacts
                ],
                "armed_s": s.duration, "free_s": s.free, "free_mean_n": s.mean, "free_sigma_n": s.sigma,
                "free_window_sigma_n": s.sigma_window,
                "threshold_width_n": s.width, "f_base_no_contact_free_n": s.f_base_free,
                "f_base_no_contact_n": s.f_base_all,
            }
            for p, d, s in columns
        ],
    }  # fmt: skip
