"""Importing an arm on the command line: the report of what was read, fitted and assumed."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console

from pretouch.cli.options import JsonFile, Numbers, OptionalFile, Paths
from pretouch.cli.robot_check import arm_numbers, joint_table, ready_said
from pretouch.cli.tables import show
from pretouch.cli.writing import numbers_to
from pretouch.importing.read import described, is_description, read_robot
from pretouch.importing.robot_import import Imported, ImportOptions, check_free, import_robot, write_folder
from pretouch.sensing.skin import OWN_SKIN
from pretouch.text_table import TextTable, tabulated

_NEGLIGIBLE = 0.001
"""What sticks out less is not spoken of [m]."""


@dataclass(frozen=True)
class Import:
    """Read your own arm from a URDF or MJCF file: fit capsules to its links, and write a description of it.

    Look at what is printed: all that the file does not say is assumed, with a sentence for each.
    """

    file: tyro.conf.Positional[str]
    """URDF file (not a xacro template) or MJCF file, or a name of the package robot_descriptions, if it is installed,
    such as ur5e_mj_description."""
    out: OptionalFile = None
    """Folder to write robot.toml and arm.xml to; by default the arm's name."""
    ee: str = ""
    """Link whose origin is the end-effector; by default the most likely one."""
    name: str = ""
    """Name of the arm; by default the file's."""
    package_path: Paths = ()
    """Folders that hold the ROS packages of package:// paths, separated by commas; those above the file are
    searched in any case."""
    qd_max: Numbers = ()
    """Joint velocity limits [rad/s], one for all or one per joint, separated by commas; by default the file's."""
    qdd_max: Numbers = ()
    """Joint acceleration limits [rad/s^2]; no file has them."""
    tau_max: Numbers = ()
    """Joint torque limits [Nm]; by default the file's."""
    ready: Numbers = ()
    """Usual start posture [rad], one position per joint, separated by commas; by default one is searched for."""
    capsules: int = 3
    """Largest number of capsules per link."""
    cover: bool = False
    """Enlarge the capsules until no surface sticks out of them: the arm then keeps more distance than necessary."""
    json: JsonFile = None

    def run(self) -> None:
        """Import an arm, print what came of it, and write its folder."""
        file, packages = Path(self.file), self.package_path
        if is_description(self.file):
            file, package = described(self.file)
            packages = (*packages, package)
        options = ImportOptions(
            ee=self.ee,
            name=self.name,
            packages=packages,
            qd_max=self.qd_max,
            qdd_max=self.qdd_max,
            tau_max=self.tau_max,
            ready=self.ready,
            capsules=self.capsules,
            cover=self.cover,
        )
        folder = self.out or Path(_file_name(self.name or read_robot(file, options.packages).name))
        check_free(folder)
        with numbers_to(self.json) as write:
            write(_imported(file, options, folder))


def _imported(file: Path, options: ImportOptions, folder: Path) -> dict[str, Any]:
    """Import an arm, write its folder, and print what came of it; return the numbers."""
    found = import_robot(file, options)
    write_folder(found, folder)
    console = Console(highlight=False)
    links = f"Links: {', '.join(found.model.links[1:])}."
    show(console, [joint_table(found.model, found.ready, links), _capsules(found)])
    for sentence in [*found.remarks, *_said(found)]:
        console.print(f"- {sentence}", markup=False, soft_wrap=True)
    units = f"pretouch skin coverage --arm {folder} --workspace joints --suggest 8 --out {folder / OWN_SKIN}"
    after = f"Next, sensor units: {units}\nThen try it: pretouch live --arm {folder}"
    console.print(f"\nWritten: {folder}. {after}", markup=False, soft_wrap=True)
    return _numbers_of(found)


def _file_name(name: str) -> str:
    """Make a folder's name of an arm's: letters, digits, dashes and dots only."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.")[:60] or "arm"


def _capsules(found: Imported) -> TextTable:
    columns = (
        ("link", lambda body: body.name),
        ("capsules", lambda body: str(len(body.rods))),
        ("stand over\n[mm]", lambda body: f"{1000 * body.stands_over:.1f}"),
        ("sticks out\n[mm]", lambda body: f"{1000 * body.sticks_out:.1f}"),
    )
    note = (
        "By how much the capsules stand over the surface at most, and it sticks out of them: a person may be that much"
        " closer."
    )
    return tabulated("Capsules for the links", columns, found.bodies, note, 1)


def _said(found: Imported) -> list[str]:
    return [
        *_sticking_out(found),
        f"{ready_said(found.ready)} Use --ready to set another one.",
        *([found.ready.conflict] if found.ready.conflict else []),
    ]


def _sticking_out(found: Imported) -> list[str]:
    """Name the moving link that sticks out most, and say what to do about it."""
    model = found.model
    moving = [body for body in found.bodies if model.moved_by[model.link_index(body.name)].any()]
    worst = max(moving, key=lambda body: body.sticks_out)
    if worst.sticks_out < _NEGLIGIBLE:
        return []
    return [
        f"Of the moving links {worst.name} sticks out of its capsules most, by {1000 * worst.sticks_out:.1f} mm: raise"
        " approach.d_repulse_m by as much, or import with --cover."
    ]


def _numbers_of(found: Imported) -> dict[str, Any]:
    links = {
        body.name: {
            "capsules": len(body.rods), "fitted": body.fitted, "sticks_out_m": body.sticks_out,
            "stands_over_m": body.stands_over,
        }
        for body in found.bodies
    }  # fmt: skip
    return arm_numbers(found.model, found.ready) | {"links": links, "remarks": found.remarks}
