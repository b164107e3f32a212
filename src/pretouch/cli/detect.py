"""What `pretouch detect` does: the detector of some profiles on a recording of any arm, as tables, figure and file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import tyro

from pretouch.cli.detect_account import ENDINGS, Account, give
from pretouch.cli.detect_torques import torque_account
from pretouch.cli.detect_words import force_guidance, sentences
from pretouch.cli.options import JsonFile, Numbers, OptionalFile, Words
from pretouch.cli.writing import check_writable, numbers_to
from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.errors import ParameterError, RecordingError
from pretouch.extras import FIGURES
from pretouch.imported_data.detect_force import ForceResult, detect_force
from pretouch.imported_data.forces import ForceRecording, read_force
from pretouch.imported_data.log import TORQUES, Choice, LogFile
from pretouch.imported_data.reading import open_log
from pretouch.imported_data.renaming import mapping_of
from pretouch.imported_data.torques import torque_recording
from pretouch.profiles import Profile, at_rate
from pretouch.profiles import profile as find_profile
from pretouch.recording.compare import Found, matched
from pretouch.text_table import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


AUTO = ("auto",)


@dataclass(frozen=True)
class Detect:
    """Detect contacts in a recording of your own arm: a ROS bag, an MCAP file, a CSV or a Parquet file."""

    file: tyro.conf.Positional[Path]
    """ROS 2 bag (folder, .mcap, .db3), ROS 1 .bag, or .csv or .parquet with columns time_s, q1_rad ..., dq1_rad_s ...
    and tau_ext1_Nm ... (or tau1_Nm ..., current1_A ...), or force_x_N, force_y_N, force_z_N; or a log of libfranka."""
    profiles: Words = AUTO
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. auto:
    pretouch,paper where there are joint torques, else paper."""
    sign: Literal["auto", "on-robot", "by-robot"] = "auto"
    """Whether force and external torques are on the robot (by its environment) or by the robot, as Franka's
    O_F_ext_hat_K; auto: on the robot, but for torques by the name tau_ext_hat_filtered."""
    frame: Literal["base", "ee"] = "base"
    """Frame of the force; ee, the end-effector's, needs joint positions of a Panda or FR3."""
    zeros: Literal["auto", "missing", "kept"] = "auto"
    """Whether six zeros mean no estimate; auto: yes with --sign by-robot."""
    wrench: str = ""
    """Topic of the force, if there are several."""
    joints: str = ""
    """Topic of the joint positions, if there are several."""
    torques: str = ""
    """Topic of the joint torques: JointState with efforts, FrankaState or FrankaRobotState; by default what is
    found."""
    arm: str = "auto"
    """The arm: panda, fr3, or the folder of `pretouch robot import`; auto: by the names of its joints, otherwise a
    Panda."""
    columns: str = ""
    """Columns of other names, THEIRS=OURS separated by commas, or FILE.toml: tau_J_0=tau1_Nm; tau_J_*=tau*_Nm is all
    joints."""
    gains: Numbers = ()
    """Torque by motor current of each joint, gear included [Nm/A], separated by commas: for current1_A."""
    payload: float = 0.0
    """Load at the end-effector that the arm's model does not have [kg]: for measured torques."""
    rate: float = 0.0
    """Rate of the detector [Hz]; by default the profile's own, 100."""
    out: OptionalFile = None
    """Figure to write, ending in .png, .pdf or .svg, or page, ending in .html."""
    json: JsonFile = None

    def run(self) -> None:
        """Run the detectors, show what they found, and write a figure or page and the numbers where asked."""
        if not all(np.isfinite(gain) and gain > 0.0 for gain in self.gains):
            raise ParameterError(
                f"--gains is {','.join(map('{:g}'.format, self.gains))}: give torques by current [Nm/A] above 0."
            )
        choice = Choice(
            self.wrench, self.joints, self.sign, self.frame, self.zeros, self.arm, self.torques,
            mapping_of(self.columns), self.gains, self.payload,
        )  # fmt: skip
        profiles = None if self.profiles == AUTO else [_profile(name, self.rate) for name in self.profiles]
        if profiles is not None and not profiles:
            raise ParameterError("No profile is given: name one or more, separated by commas.")
        out = self.out
        if out and out.suffix not in ENDINGS:
            raise RecordingError(
                f"The figure {out} has an unknown format: use one of the endings {', '.join(ENDINGS)}."
            )
        if out:
            FIGURES.need("A figure")
            check_writable("figure", out)
        with numbers_to(self.json) as write:
            give(_account(open_log(self.file, choice), choice, profiles, self.rate), out, write)


def _account(file: LogFile, choice: Choice, given: Sequence[Profile] | None, rate: float) -> Account:
    unused = []
    if _by_torques(file, choice, given):
        try:
            recording = torque_recording(file.torques(), choice)
        except RecordingError as error:
            if given is not None or "force" not in file.kinds:
                raise
            unused = [f"Joint torques are not used: {error}"]
        else:
            return torque_account(recording, given or [_profile(name, rate) for name in ("pretouch", "paper")])
    account = _force_account(read_force(file, choice), given or [_profile("paper", rate)])
    return replace(account, notes=[*unused, *account.notes])


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


def _profile(name: str, rate: float) -> Profile:
    return at_rate(find_profile(name), rate) if rate else find_profile(name)


def _force_account(force: ForceRecording, profiles: Sequence[Profile]) -> Account:
    """Run thresholds over a force, and give an account of what they found."""
    results = [detect_force(force, profile) for profile in profiles]
    notes = sentences([*force.notes, *(note for r in results for note in r.notes)])
    if any(r.profile.perception is not None and thresholds_of(r.profile.detect).f_d_n for r in results):
        notes.append("Without a skin no obstacle is known, so eq. 11 lowers no threshold.")
    first, *others = (r.decisions for r in results)
    guidance = []
    for d in others:
        both, only_first, only_other = matched(first.contacts, d.contacts)
        guidance.append(
            f"{first.name} and {d.name}: {len(both)} contacts in both, {len(only_first)} only in {first.name},"
            f" {len(only_other)} only in {d.name}."
        )
    guidance += map(force_guidance, results)
    figures = partial(_figures, results, force.place.name)
    tables = [_contacts(results), _free_motion(results)]
    return Account(force, notes, tables, guidance, figures, {"profiles": [_of_profile(r) for r in results]})


def _figures(results: list[ForceResult], title: str) -> list[tuple["Figure", str]]:
    from pretouch.imported_data.figures import decisions_figure

    caption = "Force along each axis between its thresholds, and contacts."
    return [(decisions_figure([r.decisions for r in results], title), caption)]


def _contacts(results: list[ForceResult]) -> TextTable:
    rows = []
    for name, c in sorted(((r.decisions.name, c) for r in results for c in r.decisions.contacts), key=_time):
        force = [f"{value:.1f}" for value in (*c.force, np.linalg.norm(c.force))]
        rows.append((name, f"{c.time:.3f}", *force, axes_shown(c)))
    header = ("profile", "time [s]", "x", "y", "z", "norm", "axes")
    note = "Force on the robot, base frame, less its mean (eq. 12); axes whose threshold it crossed."
    return TextTable("Contacts [N]", header, tuple(rows) or (("none", *[""] * 6),), note, 1)


def _time(pair: tuple[str, Found]) -> float:
    return pair[1].time


def axes_shown(found: Found) -> str:
    """Name the axes whose threshold a contact crossed."""
    return "".join(axis for axis, crossed in zip("xyz", found.axes, strict=True) if crossed)


def _free_motion(results: list[ForceResult]) -> TextTable:
    rows = []
    for s in results:
        name = f"{s.decisions.name}, {s.free:.1f} of {s.duration:.1f} s"
        for axis, *values in zip("xyz", s.mean, s.sigma, s.sigma_window, s.width, strict=True):
            rows.append((name if axis == "x" else "", axis, *(f"{value:.2f}" for value in values)))
    header = ("profile", "along", "mean", "sigma", "sigma in window", "thresholds at +-")
    return TextTable("Free motion [N]", header, tuple(rows), "Outside contacts and reactions.")


def _of_profile(r: ForceResult) -> dict[str, Any]:
    return {
        "profile": r.decisions.name, "control_rate_hz": 1 / r.profile.task.control_period_s,
        "contacts": [
            {"time_s": c.time, "force_n": c.force, "norm_n": np.linalg.norm(c.force), "axes": axes_shown(c)}
            for c in r.decisions.contacts
        ],
        "armed_s": r.duration, "free_s": r.free, "free_mean_n": r.mean, "free_sigma_n": r.sigma,
        "free_window_sigma_n": r.sigma_window,
        "threshold_width_n": r.width, "f_base_no_contact_free_n": r.f_base_free, "f_base_no_contact_n": r.f_base_all,
    }  # fmt: skip
