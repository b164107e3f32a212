"""Importing an arm on the command line: the report of what was read, fitted and assumed."""

import re
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from pretouch.cli.robot_check import arm_numbers, joint_table, ready_said
from pretouch.cli.tables import show
from pretouch.cli.words import words
from pretouch.cli.writing import numbers_to
from pretouch.errors import ParameterError
from pretouch.importing.body import FARTHEST, FitError
from pretouch.importing.described import described
from pretouch.importing.folder import check_free, write_folder
from pretouch.importing.read import read_source
from pretouch.importing.robot_import import Imported, ImportOptions, import_robot
from pretouch.robot.named import is_description
from pretouch.sensing.skin import OWN_SKIN
from pretouch.text_table import TextTable

if TYPE_CHECKING:
    from pretouch.cli.robot_commands import Import

_NEGLIGIBLE = 0.001
"""What sticks out less is not spoken of [m]."""


def import_arm(command: "Import") -> None:
    """Import an arm, print what came of it, and write its folder."""
    file, packages = Path(command.file), tuple(Path(folder) for folder in words(command.package_path))
    if is_description(command.file):
        file, package = described(command.file)
        packages = (*packages, package)
    options = ImportOptions(
        ee=command.ee,
        name=command.name,
        packages=packages,
        qd_max=_numbers("--qd-max", command.qd_max),
        qdd_max=_numbers("--qdd-max", command.qdd_max),
        tau_max=_numbers("--tau-max", command.tau_max),
        ready=_numbers("--ready", command.ready),
        capsules=command.capsules,
        cover=command.cover,
    )
    folder = Path(command.out or _file_name(command.name or read_source(file, options.packages).name))
    check_free(folder)
    with numbers_to(command.json) as write:
        write(_imported(command, file, options, folder))


def _imported(command: "Import", file: Path, options: ImportOptions, folder: Path) -> dict[str, Any]:
    """Import an arm, write its folder, and print what came of it; return the numbers."""
    found = import_robot(file, options)
    write_folder(found, folder)
    console = Console(highlight=False)
    links = f"Links: {', '.join(found.model.links[1:])}."
    show(console, [joint_table(found.model, found.ready, links), _capsules(found)])
    for sentence in [*found.remarks, *_said(found)]:
        console.print(f"- {sentence}", markup=False, soft_wrap=True)
    where = "" if found.model.n >= 6 else " --workspace joints"
    units = f"pretouch skin coverage --arm {folder}{where} --suggest 8 --out {folder / OWN_SKIN}"
    after = f"Next, sensor units: {units}\nThen try it: pretouch live --arm {folder}"
    console.print(f"\nWritten: {folder}. {after}", markup=False, soft_wrap=True)
    return _numbers_of(found)


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in words(text))
    except ValueError:
        raise ParameterError(f"{option} is {text!r}: give numbers, separated by commas.") from None


def _file_name(name: str) -> str:
    """Make a folder's name of an arm's: letters, digits, dashes and dots only."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.")[:60] or "arm"


def _capsules(found: Imported) -> TextTable:
    rows = []
    for body in found.bodies:
        name = found.arm.source.links[body.link].name
        rows.append((name, str(len(body.rods)), *_row(body.error), f"{1000 * body.sticks_out:.1f}"))
    out = max((body.sticks_out for body in found.bodies), default=0.0)
    rows.append(("whole arm", str(sum(len(b.rods) for b in found.bodies)), *_row(found.error), f"{1000 * out:.1f}"))
    note = (
        f"Distance to the capsules minus distance to the surfaces, of points outside within {FARTHEST:g} m; of the"
        f" whole arm in {found.error.points} places in many postures. Negative: the capsules extend beyond the surface."
        " Last: the largest distance by which the surface sticks out of the capsules; a person may be closer by that"
        " much."
    )
    header = ("link", "capsules", "p5\n[mm]", "p95\n[mm]", "largest\n[mm]", "rms\n[mm]", "sticks out\n[mm]")
    return TextTable("Capsules for the links", header, tuple(rows), note, 1)


def _row(error: FitError) -> tuple[str, ...]:
    values = (error.p5, error.p95, error.largest, error.rms)
    return tuple(f"{1000 * value:.1f}" if error.points else "-" for value in values)


def _said(found: Imported) -> list[str]:
    return [
        *_sticking_out(found),
        f"{ready_said(found.ready)} Use --ready to set another one.",
        *([found.ready.conflict] if found.ready.conflict else []),
    ]


def _sticking_out(found: Imported) -> list[str]:
    """Name the moving link that sticks out most, and say what to do about it."""
    links, model = found.arm.source.links, found.model
    moving = [body for body in found.bodies if model.moved_by[model.link_index(links[body.link].name)].any()]
    worst = max(moving, key=lambda body: body.sticks_out)
    if worst.sticks_out < _NEGLIGIBLE:
        return []
    return [
        f"Of the moving links {links[worst.link].name} sticks out of its capsules most, by"
        f" {1000 * worst.sticks_out:.1f} mm: raise approach.d_repulse_m by as much, or import with --cover."
    ]


def _numbers_of(found: Imported) -> dict[str, Any]:
    links = {
        found.arm.source.links[body.link].name: {
            "capsules": len(body.rods), "fitted": body.fitted, "sticks_out_m": body.sticks_out,
            **_fit_numbers(body.error),
        }
        for body in found.bodies
    }  # fmt: skip
    fit = {"whole_arm": _fit_numbers(found.error), "links": links, "remarks": found.remarks}
    return arm_numbers(found.model, found.ready) | fit


def _fit_numbers(error: FitError) -> dict[str, float]:
    return {key if key == "points" else f"{key}_m": value for key, value in asdict(error).items()}
