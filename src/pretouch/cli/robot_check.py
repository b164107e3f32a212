"""Checking an imported arm on the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console

from pretouch.cli.options import JsonFile, OptionalFile
from pretouch.cli.tables import show
from pretouch.cli.writing import numbers_to
from pretouch.errors import RobotModelError
from pretouch.importing.ready import Ready, check_posture, never_apart, rated
from pretouch.robot.description import FILE, load_description
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import OWN_SKIN, load_skin
from pretouch.text_table import TextTable, tabulated


@dataclass(frozen=True)
class Check:
    """Check an arm's folder after a change by hand, and report what is wrong with it."""

    folder: tyro.conf.Positional[Path]
    """Folder of the arm, or its robot.toml."""
    skin: OptionalFile = None
    """Skin file; by default the folder's own."""
    json: JsonFile = None

    def run(self) -> None:
        """Load an arm and its skin, and print what is known of them; what is wrong is an error of this package."""
        with numbers_to(self.json) as write:
            write(_checked(self))


def _checked(command: Check) -> dict[str, Any]:
    description = load_description(command.folder)
    file = command.folder / FILE if command.folder.is_dir() else command.folder
    try:
        model = RobotModel(description)
    except RobotModelError as error:
        raise RobotModelError(f"{error} (in {file}, or its {description.mjcf.name})") from error
    check_posture(description.q_ready, model.q_min, model.q_max, f"{file}: q_ready")
    ready = rated(model, description.q_ready)
    own = file.parent / OWN_SKIN
    skin = load_skin(command.skin or own, model) if command.skin or own.exists() else None
    together = ", ".join(f"{a} and {b}" for a, b in never_apart(model)) or "none"
    note = (
        f"{len(model.capsules.radius)} capsules, {len(model.body.radius)} of them on moving links. {ready_said(ready)}"
        f" Units: {', '.join(skin.ids) if skin else 'no skin file'}. Pairs of links that always touch, so they are not"
        f" checked: {together}."
    )
    console = Console(highlight=False)
    show(console, [joint_table(model, ready, note)])
    if ready.conflict:
        raise RobotModelError(f"{ready.conflict} ({file}: q_ready)")
    console.print(f"No problem found: {command.folder}.", markup=False, soft_wrap=True)
    return arm_numbers(model, ready) | {"units": skin.ids if skin else None}


def arm_numbers(model: RobotModel, ready: Ready) -> dict[str, Any]:
    """Return what is known of an arm, and its ready posture, as JSON is to have them."""
    limits = {"joints": model.joints, "q_min": model.q_min, "q_max": model.q_max}
    return {"arm": model.description, "ready": ready, "never_apart": never_apart(model)} | limits


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
    """Say what a posture is good for."""
    return (
        f"Ready posture: manipulability {ready.manipulability:.3g}, smallest singular value {ready.singular_value:.3g},"
        f" {1000 * ready.clear:.0f} mm clear of itself."
    )
