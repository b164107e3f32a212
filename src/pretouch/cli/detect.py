"""`pretouch detect`: the detectors of some profiles on a recording of any arm, as tables, page and file."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tyro
from rich.console import Console

from pretouch.atomic_write import atomic_write
from pretouch.cli.detect_words import guidance, read_from, sentences, shown
from pretouch.cli.options import JsonFile, OptionalFile, Words
from pretouch.cli.tables import show
from pretouch.cli.writing import check_writable, numbers_to, unwritable_said
from pretouch.errors import ParameterError, RecordingError
from pretouch.extras import FIGURES
from pretouch.imported_data.detect import detect
from pretouch.imported_data.log import TORQUES, Choice
from pretouch.imported_data.reading import ForceRecording, open_log, read_force
from pretouch.imported_data.results import Course, DetectorResult, TorqueCourse
from pretouch.imported_data.torques import TorqueRecording, torque_recording
from pretouch.profiles import Profile, at_rate
from pretouch.profiles import profile as find_profile
from pretouch.text_table import TextTable, tabulated

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AUTO = ("auto",)
_NO = "–"


@dataclass(frozen=True)
class Detect(Choice):
    """Detect contacts in a recording of your own arm: a ROS bag, an MCAP file, a CSV or a Parquet file."""

    file: tyro.conf.Positional[Path]
    """ROS 2 bag (folder, .mcap, .db3), ROS 1 .bag, or .csv or .parquet with columns time_s, q1_rad ..., dq1_rad_s ...
    and tau_ext1_Nm ... (or tau1_Nm ..., current1_A ...), or force_x_N, force_y_N, force_z_N; or a log of libfranka."""
    profiles: Words = AUTO
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. auto:
    pretouch,paper where there are joint torques, else paper."""
    arm: str = field(default="auto", kw_only=True)
    """The arm: panda, fr3, or the folder of `pretouch robot import`; auto: by the names of its joints, otherwise a
    Panda."""
    rate: float = 0.0
    """Rate of the detector [Hz]; by default the profile's own, 100."""
    out: OptionalFile = None
    """Page with figures to write, an .html file."""
    json: JsonFile = None

    def run(self) -> None:
        """Run the detectors, show their results, and write page and numbers if requested."""
        if not all(np.isfinite(gain) and gain for gain in self.gains):
            raise ParameterError(
                f"--gains is {','.join(map('{:g}'.format, self.gains))}: give torques by current [Nm/A], none of 0."
            )
        profiles = None if self.profiles in (AUTO, ()) else [self._profile(name) for name in self.profiles]
        if self.out:
            FIGURES.need("A page with figures")
            check_writable("page", self.out)
        with numbers_to(self.json) as write:
            file = open_log(self.file, self)
            by_torques = _by_torques(file.kinds, self, profiles)
            recording = torque_recording(file.torques(), self) if by_torques else read_force(file, self)
            names = ("pretouch", "paper") if isinstance(recording, TorqueRecording) else ("paper",)
            answer = _answer(recording, profiles or [self._profile(name) for name in names])
            write(answer.numbers())
            answer.show()
            if self.out:
                answer.draw(self.out)
                print(f"Page: {self.out}")

    def _profile(self, name: str) -> Profile:
        return at_rate(find_profile(name), self.rate) if self.rate else find_profile(name)


def _by_torques(kinds: frozenset[str], choice: Choice, profiles: Sequence[Profile] | None) -> bool:
    """Return True if detectors run on joint torques: where a log has their kind and not only thresholds are wanted."""
    if choice.torques or choice.gains or choice.payload:
        return choice.frame != "ee"
    by_force = profiles is not None and not any(p.detect.by_torques for p in profiles)
    if choice.frame == "ee" or choice.wrench or (by_force and "force" in kinds):
        return False
    return bool(kinds.intersection(TORQUES)) or ("force" not in kinds and bool(kinds & {"q", "dq"}))


@dataclass(frozen=True)
class _Results:
    """Results of detectors on a recording."""

    recording: ForceRecording | TorqueRecording
    results: list[DetectorResult]
    courses: list[Course]
    notes: list[str]
    """Sentences on the data and on the results."""

    @property
    def tables(self) -> list[TextTable]:
        """Tables of contacts, of the detectors, and of free motion."""
        return [
            _contacts(self.results),
            *_alarms(self.results, self.recording.model.joints),
            _detection(self.results),
            *_free_motion(self.results),
        ]

    def numbers(self) -> dict[str, Any]:
        """Return the contents of the JSON file."""
        r = self.recording
        return {
            "recording": str(r.place),
            "arm": r.model.description.name,
            "assumed": read_from(r),
            "notes": self.notes,
            "data": r.notes,
            "samples": len(r.time),
            "first_sample_s": r.first_s,
            "duration_s": r.time[-1],
            "rate_hz": r.rate,
            "profiles": self.results,
        }

    def show(self) -> None:
        """Print sentences and tables."""
        r, console = self.recording, Console(highlight=False, soft_wrap=True)
        first = (
            f"{r.place}: {len(r.time)} samples in {r.time[-1]:.1f} s, {r.rate:.4g} Hz, the first at {r.first_s:.3f} s:"
            " times below count from it."
        )
        for sentence in (first, read_from(r), *self.notes):
            console.print(sentence, markup=False)
        show(console, self.tables)
        for sentence in guidance(self.results):
            console.print(sentence, markup=False)

    def draw(self, out: Path) -> None:
        """Write a page of sentences, tables and figures."""
        from pretouch.reporting.page import detection_page  # needs the extra

        text = [*guidance(self.results), read_from(self.recording), *self.notes]
        page = detection_page(self.recording.place.name, text, self.tables, self._figures())
        with unwritable_said("page", out):
            atomic_write(out, page)

    def _figures(self) -> list[tuple["Figure", str]]:
        """Draw figures, each with its caption."""
        from pretouch.imported_data.figures import decisions_figure, torque_figure  # needs the extra

        title, caption = self.recording.place.name, "joint torques, what free motion does not explain of them, and"
        figures, forces = [], []
        for result, course in zip(self.results, self.courses, strict=True):
            if isinstance(course, TorqueCourse):
                figure = torque_figure(course, self.recording.model.joints, f"{title}: {result.profile}")
                figures.append((figure, f"{result.profile}: {caption} the evidence. Red: contacts."))
            else:
                forces.append(course)
        return [*figures, (decisions_figure(forces, title), "Force, thresholds, and contacts.")] if forces else figures


def _answer(recording: ForceRecording | TorqueRecording, profiles: Sequence[Profile]) -> _Results:
    """Run profiles over a recording. One that cannot run is a note, if another can."""
    results, courses, notes = list[DetectorResult](), list[Course](), sentences(recording.notes)
    failures: list[RecordingError] = []
    for profile in profiles:
        try:
            result, course = detect(recording, profile)
        except RecordingError as error:
            failures.append(error)
            notes.append(f"{profile.name} cannot run: {error}")
        else:
            results.append(result)
            courses.append(course)
            notes += [text for text in sentences(result.notes) if text not in notes]
    if not results:
        raise failures[0]
    return _Results(recording, results, courses, notes)


def _contacts(results: list[DetectorResult]) -> TextTable:
    pairs = sorted(((r.profile, c) for r in results for c in r.contacts), key=lambda pair: pair[1].time_s)
    rows = []
    for name, c in pairs:
        place = np.full(3, np.nan) if c.point_m is None else c.point_m
        force = (*c.force_n, c.norm_n)
        numbers = (f"{c.time_s:.3f}", *(shown(x, 3) for x in place), *(shown(x, 1) for x in force))
        link = (" or ".join(c.links) if len(c.links) < 3 else "cannot be told") or _NO
        rows.append((name, link, *numbers, c.axes or _NO))
    header = ("profile", "link", "time [s]", *(f"{a} [m]" for a in "xyz"), "force x [N]", "y", "z", "norm", "axes")
    note = (
        "Force on the robot, base frame. A detector on torques gives link, place and force of its strongest evidence,"
        " and all links that its torques could be of, or that they cannot be told."
        " A detector on thresholds gives the force at the end-effector less its mean (eq. 12), and the axes whose"
        " threshold the force crossed."
    )
    return TextTable("Contacts", header, tuple(rows) or (("none", *[""] * 10),), note, 1)


def _alarms(results: list[DetectorResult], joints: Sequence[str]) -> list[TextTable]:
    """Return a table of what each alarm by torques looked like, if there is one."""
    rows = []
    for name, time, look in ((r.profile, c.time_s, c.circumstances) for r in results for c in r.contacts):
        if look:
            j, speeds = joints.index(look.joint), np.abs(look.speed_rad_s)
            numbers = look.residual_nm[j], look.sigma_nm[j], look.free_motion_nm[j], speeds[j], speeds.max()
            arm = ", ".join(f"{count} {word}" for word, count in Counter(look.doing).most_common())
            rows.append((name, look.joint, f"{time:.3f}", *(shown(x, 2) for x in numbers), look.doing[j], arm))
    header = "profile", "joint", "time [s]", "residual [Nm]", "sigma", "free motion [Nm]", "speed [rad/s]", "fastest"
    note = (
        "The joint with the most unusual residual at the alarm, its deviation in free motion, what learnt free motion"
        " explains there, and what joints do within 0.3 s: alarms of joints that set out or reverse may be friction."
    )
    return [TextTable("Alarms", (*header, "joint is", "all joints"), tuple(rows), note)] if rows else []


def _detection(results: list[DetectorResult]) -> TextTable:
    columns = [
        ("profile", lambda r: r.profile),
        ("contacts", lambda r: str(len(r.contacts))),
        ("armed [s]", lambda r: shown(r.armed_s, 1)),
        ("contacts per hour", lambda r: shown(r.contacts_per_hour, 1)),
        ("evidence without contact", lambda r: shown(r.largest_evidence, 2)),
        ("detectable [N]", lambda r: shown(r.detectable_n, 1)),
    ]
    note = (
        "Per hour: all contacts by the armed time, at rest and in motion. Evidence of 1 or more is a contact."
        " Detectable: force at the end-effector that the detector itself expects to detect, in the direction in which"
        " the torques are least sensitive (median); for the paper's thresholds, their distance from the mean."
    )
    return tabulated("Detection", columns, results, note, 1)


def _free_motion(results: list[DetectorResult]) -> list[TextTable]:
    """Return a table of the forces in free motion, if a profile goes by them."""
    rows = []
    for r in results:
        if t := r.thresholds:
            for axis, *values in zip("xyz", t.mean_n, t.sigma_n, t.width_n, strict=True):
                rows.append((r.profile if axis == "x" else "", axis, *(shown(value, 2) for value in values)))
    header, note = ("profile", "along", "mean", "sigma", "thresholds at +-"), "Outside contacts and reactions."
    return [TextTable("Free motion [N]", header, tuple(rows), note)] if rows else []
