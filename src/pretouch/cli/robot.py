"""`pretouch robot import` and `skin import`: arms and skins of other programs, and reports on them."""

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import tyro
from rich.console import Console

from pretouch.cli.options import JsonFile, OptionalFile, Paths, Words
from pretouch.cli.tables import show
from pretouch.cli.writing import check_outputs, numbers_to
from pretouch.importing.capsules import LinkBody
from pretouch.importing.read import read_robot
from pretouch.importing.ready import Ready
from pretouch.importing.robot_import import ImportOptions, check_free, import_robot, write_folder
from pretouch.importing.skin import Beam, chosen, fixed_links, mounted, units_of_links, units_of_table
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import sensor_called
from pretouch.sensing.skin import OWN_SKIN, Skin, save_skin
from pretouch.text_table import TextTable, tabulated

_NEGLIGIBLE = 0.001
"""Least distance outside of the capsules that is mentioned [m]."""
_INWARD = -0.02
"""Cosine of the angle from the outward normal below which a unit looks into the arm."""


@dataclass(frozen=True, kw_only=True)
class ImportArm(ImportOptions):
    """Read your own arm from a URDF or MJCF file: fit capsules to its links, and write a description of it.

    Look at what is printed: all that the file does not say is assumed, with a sentence for each.
    """

    file: tyro.conf.Positional[Path]
    """URDF, xacro or MJCF file; a xacro file needs the package xacrodoc or xacro."""
    out: OptionalFile = None
    """Folder to write robot.toml and arm.xml to; by default the arm's name."""
    json: JsonFile = None

    def run(self) -> None:
        """Import an arm, print a report, and write its folder."""
        folder = self.out
        if not folder:  # of the arm's name: letters, digits, dashes and dots only
            name = self.name or read_robot(self.file, self.package_path, self.xacro).name
            folder = Path(re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.")[:60] or "arm")
        check_free(folder)
        with numbers_to(self.json) as write:
            write(_imported(self.file, self, folder))


def _imported(file: Path, options: ImportOptions, folder: Path) -> dict[str, Any]:
    """Import an arm, write its folder, and print a report; return the numbers."""
    imported = import_robot(file, options)
    model, ready = imported.model, imported.ready
    write_folder(imported, folder)
    console = Console(highlight=False)
    show(console, [joint_table(model, ready, f"Links: {', '.join(model.links[1:])}."), _capsules(imported.bodies)])
    moving = [body for body in imported.bodies if model.moved_by[model.link_index(body.name)].any()]
    worst = max(moving, key=lambda body: body.sticks_out)
    sentences = [*imported.remarks, f"{ready_said(ready)} Use --ready to set another one."]
    if worst.sticks_out >= _NEGLIGIBLE:
        sentences.append(
            f"Of the moving links {worst.name} sticks out of its capsules most, by {1000 * worst.sticks_out:.1f} mm:"
            " raise approach.d_repulse_m by as much, or import with --cover."
        )
    if ready.conflict:
        sentences.append(ready.conflict)
    for sentence in sentences:
        console.print(f"- {sentence}", markup=False, soft_wrap=True)
    units = f"pretouch skin coverage --arm {folder} --workspace joints --suggest 8 --out {folder / OWN_SKIN}"
    after = f"Next, sensor units: {units}\nThen try it: pretouch live --arm {folder}"
    console.print(f"\nWritten: {folder}. {after}", markup=False, soft_wrap=True)
    limits = {"joints": model.joints, "q_min": model.q_min, "q_max": model.q_max}
    parts = {"arm": model.description, "ready": ready, "links": imported.bodies, "remarks": imported.remarks}
    return parts | limits


def _capsules(bodies: tuple[LinkBody, ...]) -> TextTable:
    columns = (
        ("link", lambda body: body.name),
        ("capsules", lambda body: str(len(body.rods))),
        ("stand over\n[mm]", lambda body: f"{1000 * body.stands_over:.1f}"),
        ("sticks out\n[mm]", lambda body: f"{1000 * body.sticks_out:.1f}"),
    )
    note = (
        "Stand over: greatest distance of the capsules beyond the surface. Sticks out: greatest distance of the surface"
        " outside of them; a person may be closer by that much."
    )
    return tabulated("Capsules for the links", columns, bodies, note, 1)


def joint_table(model: RobotModel, ready: Ready, note: str) -> TextTable:
    """Show the limits of an arm's joints and their places in the ready posture."""
    arm = model.description
    columns = (
        ("joint", lambda j: model.joints[j]),
        ("lower\n[rad]", lambda j: f"{model.q_min[j]:.3f}"),
        ("upper\n[rad]", lambda j: f"{model.q_max[j]:.3f}"),
        ("speed\n[rad/s]", lambda j: f"{arm.qd_max[j]:.3g}"),
        ("accel.\n[rad/s^2]", lambda j: f"{arm.qdd_max[j]:.3g}"),
        ("torque\n[Nm]", lambda j: f"{arm.tau_max[j]:.3g}"),
        ("ready\n[rad]", lambda j: f"{ready.q[j]:.3f}"),
    )
    return tabulated(f"{arm.name}: {model.n} joints, end-effector {arm.ee_body}", columns, range(model.n), note, 1)


def ready_said(ready: Ready) -> str:
    """Return a sentence on the quality of a posture."""
    return (
        f"Ready posture: smallest singular value {ready.singular_value:.3g}, {1000 * ready.clear:.0f} mm clear of"
        " itself."
    )


@dataclass(frozen=True, kw_only=True)
class ImportSkin:
    """Make a skin file of units that are links of a URDF, or poses in a CSV or YAML file, and say where each looks."""

    file: tyro.conf.Positional[Path]
    """URDF, xacro or MJCF file with the units as links that are fixed to the arm's; or a CSV or YAML file of poses."""
    arm: str = "panda"
    """The arm that wears them: panda, fr3, or the folder of an imported arm."""
    links: str = ""
    """Names of the units' links, or patterns such as 'prox_*', separated by commas; by default they are asked for."""
    sensor: str = "vl53l1x"
    """Type of their sensors, where the file says none: vl53l1x, vl53l5cx, vl53l7cx or capacitive."""
    beam: Beam = "z"
    """Axis of the units' frames along which they look: x for frames of ROS that are not optical."""
    package_path: Paths = ()
    """Folders that hold ROS packages, separated by commas."""
    xacro: Words = ()
    """Arguments of a xacro file, as NAME:=VALUE, separated by commas."""
    out: Path = Path(OWN_SKIN)
    """Skin file to write; skin.toml in an imported arm's folder is the arm's own."""
    json: JsonFile = None
    replace: bool = False
    """Overwrite existing files."""

    def run(self) -> None:
        """Read the units, show them, and write the skin file."""
        model = RobotModel(robot_named(self.arm))
        check_outputs([("skin file", self.out), ("file", self.json)], [self.file], self.replace)
        with numbers_to(self.json) as write:
            write(_imported_skin(self, model))


def _imported_skin(command: ImportSkin, model: RobotModel) -> dict[str, Any]:
    """Read units, print where they look, write them as a skin file, and return the numbers."""
    sensor = sensor_called(command.sensor, "--sensor", {})
    if command.file.suffix.lower() in (".csv", ".tsv", ".txt", ".yaml", ".yml"):
        rows = units_of_table(command.file, model, sensor)
    else:
        robot = read_robot(command.file, command.package_path, command.xacro)
        names = chosen(fixed_links(robot), command.links, input if sys.stdin.isatty() else None)
        rows = units_of_links(robot, model, names, sensor)
    units = [mounted(row, model, command.beam) for row in rows]
    kin, sentences = model.kinematics(model.description.q_ready), list[str]()
    columns = (
        ("unit", lambda one: one.unit.id),
        ("link", lambda one: one.unit.link),
        ("position\n[m]", lambda one: _vector(one.unit.T_link_sensor[:3, 3], 3)),
        ("looks along,\nin the link", lambda one: _vector(one.unit.T_link_sensor[:3, 2], 2)),
        (
            "in the\nbase",
            lambda one: _vector(kin.rotation[model.link_index(one.unit.link)] @ one.unit.T_link_sensor[:3, 2], 2),
        ),
        ("off normal\n[deg]", lambda one: f"{np.rad2deg(np.arccos(np.clip(one.outward, -1, 1))):.0f}"),
    )
    note = "In the base: in the ready posture. Off normal: angle from the outward normal of the link's capsule."
    if inward := [one.unit.id for one in units if one.outward < _INWARD]:
        outward = {beam: sum(mounted(row, model, beam).outward > 0.5 for row in rows) for beam in get_args(Beam)}
        best = max(outward, key=lambda beam: (outward[beam], beam == command.beam))
        other = f" With --beam={best}, {outward[best]} of {len(rows)} look outwards." if best != command.beam else ""
        sentences.append(f"Look into the arm: {', '.join(inward)}.{other}")
    if raised := [f"{one.unit.id} by {1000 * one.raised:.1f} mm" for one in units if one.raised]:
        sentences.append(f"Raised to the surface of the capsules, which stand over the arm's: {', '.join(raised)}.")
    console = Console(highlight=False)
    show(console, [tabulated(f"{len(units)} units on {model.description.name}", columns, units, note)])
    for sentence in sentences:
        console.print(f"- {sentence}", markup=False, soft_wrap=True)
    save_skin(Skin([one.unit for one in units], model), command.out)
    console.print(f"Skin: {command.out}", markup=False, soft_wrap=True)
    return {"arm": model.description.name, "units": units, "remarks": sentences}


def _vector(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
