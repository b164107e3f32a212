"""Importing an arm on the command line: the report of what was read, fitted and assumed."""

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from pretouch.cli.robot_commands import Import
from pretouch.cli.tables import show
from pretouch.cli.words import words
from pretouch.cli.writing import check_writable, unwritable_said
from pretouch.errors import ParameterError
from pretouch.experiments.campaign import write_json
from pretouch.experiments.tables import TextTable
from pretouch.importing.body import FARTHEST, FitError
from pretouch.importing.folder import check_free, write_folder
from pretouch.importing.robot_import import Imported, ImportOptions, import_robot


def import_arm(command: Import) -> None:
    """Import an arm, print what came of it, and write its folder."""
    options = ImportOptions(
        ee=command.ee,
        name=command.name,
        packages=tuple(Path(folder) for folder in words(command.package_path)),
        qd_max=_numbers("--qd-max", command.qd_max),
        qdd_max=_numbers("--qdd-max", command.qdd_max),
        tau_max=_numbers("--tau-max", command.tau_max),
        ready=_numbers("--ready", command.ready),
        capsules=command.capsules,
    )
    if command.out:
        check_free(Path(command.out), command.force)
    if command.json:
        check_writable("file", Path(command.json))
    found = import_robot(Path(command.file), options)
    folder = Path(command.out or _file_name(found.description.name))
    kept = write_folder(found, folder, command.force)
    console = Console(highlight=False)
    show(console, [_joints(found), _capsules(found)])
    for sentence in [*found.remarks, *_said(found)]:
        console.print(f"- {sentence}", markup=False, soft_wrap=True)
    if kept:
        console.print(f"What was in {folder} is in {kept}.", markup=False, soft_wrap=True)
    console.print(
        f"\nWritten: {folder}. Try it: pretouch reproduce static --arm {folder} --seeds 1", markup=False, soft_wrap=True
    )
    if command.json:
        with unwritable_said("file", Path(command.json)):
            write_json(_numbers_of(found), Path(command.json))


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in words(text))
    except ValueError:
        raise ParameterError(f"{option} is {text!r}: give numbers, separated by commas.") from None


def _file_name(name: str) -> str:
    """Make a folder's name of an arm's: letters, digits, dashes and dots only."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.")[:60] or "arm"


def _joints(found: Imported) -> TextTable:
    limits = found.limits
    rows = [
        (
            joint.name, f"{limits.q_min[j]:.3f}", f"{limits.q_max[j]:.3f}", f"{limits.qd_max[j]:.3g}",
            f"{limits.qdd_max[j]:.3g}", f"{limits.tau_max[j]:.3g}", f"{found.ready.q[j]:.3f}",
        )
        for j, joint in enumerate(found.arm.joints)
    ]  # fmt: skip
    header = (
        "joint",
        "lower\n[rad]",
        "upper\n[rad]",
        "speed\n[rad/s]",
        "accel.\n[rad/s^2]",
        "torque\n[Nm]",
        "ready\n[rad]",
    )
    title = f"{found.description.name}: {len(rows)} joints, end-effector {found.description.ee_body}"
    return TextTable(title, header, tuple(rows), "Links: " + ", ".join(found.model.links[1:]) + ".", 1)


def _capsules(found: Imported) -> TextTable:
    rows = []
    for body in found.bodies:
        name = found.arm.source.links[body.link].name
        rows.append((name, str(len(body.rods)), *_row(body.error), f"{1000 * body.sticks_out:.1f}"))
    out = max((body.sticks_out for body in found.bodies), default=0.0)
    rows.append(("whole arm", str(sum(len(b.rods) for b in found.bodies)), *_row(found.error), f"{1000 * out:.1f}"))
    note = (
        "Distance to the capsules minus distance to the surfaces, of points outside within"
        f" {FARTHEST:g} m; of the whole arm in {found.error.points} places in many postures. Negative: the capsules"
        " stand over the surface. Last: how far the surface sticks out of the capsules at most; a person may be that"
        " much nearer."
    )
    header = ("link", "capsules", "p5\n[mm]", "p95\n[mm]", "largest\n[mm]", "rms\n[mm]", "sticks out\n[mm]")
    return TextTable("Capsules for the links", header, tuple(rows), note, 1)


def _row(error: FitError) -> tuple[str, ...]:
    return tuple(f"{1000 * value:.1f}" for value in (error.p5, error.p95, error.largest, error.rms))


def _said(found: Imported) -> list[str]:
    ready = found.ready
    units = ", ".join(f"{unit.id} ({unit.link})" for unit in found.skin.units) or "none"
    return [
        f"Ready posture: manipulability {ready.manipulability:.3g}, smallest singular value {ready.singular_value:.3g},"
        f" {1000 * ready.clear:.0f} mm clear of itself; --ready gives another one.",
        f"Proposed units: {units}. skin.toml holds where each would sit; give yours, or calibrate them.",
    ]


def _numbers_of(found: Imported) -> dict[str, Any]:
    links = {
        found.arm.source.links[body.link].name: {
            "capsules": len(body.rods), "fitted": body.fitted, "sticks_out": body.sticks_out, **asdict(body.error)
        }
        for body in found.bodies
    }  # fmt: skip
    return {"name": found.description.name, "whole_arm": asdict(found.error), "links": links,
            "q_ready": found.ready.q.tolist(), "remarks": list(found.remarks)}  # fmt: skip
