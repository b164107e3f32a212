"""Checking an imported arm on the command line."""

from pathlib import Path

from rich.console import Console

from pretouch.cli.robot_commands import Check
from pretouch.cli.tables import show
from pretouch.experiments.tables import TextTable
from pretouch.importing.folder import SKIN
from pretouch.importing.ready import rated
from pretouch.robot.description_file import load_description
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin


def check_arm(command: Check) -> None:
    """Load an arm and its skin, and print what is known of them; what is wrong is an error of this package."""
    folder = Path(command.folder)
    description = load_description(folder)
    model = RobotModel(description)
    ready = rated(model, description.q_ready)
    own = (folder if folder.is_dir() else folder.parent) / SKIN
    skin = load_skin(command.skin or own, model) if command.skin or own.exists() else None
    rows = [
        (
            name, f"{model.q_min[j]:.3f}", f"{model.q_max[j]:.3f}", f"{description.qd_max[j]:.3g}",
            f"{description.qdd_max[j]:.3g}", f"{description.tau_max[j]:.3g}", f"{ready.q[j]:.3f}",
        )
        for j, name in enumerate(model.joints)
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
    note = (
        f"{len(model.capsules)} capsules, {len(model.body)} of them on moving links. Ready posture: manipulability"
        f" {ready.manipulability:.3g}, smallest singular value {ready.singular_value:.3g}, {1000 * ready.clear:.0f} mm"
        f" clear of itself. Units: {', '.join(skin.ids) if skin else 'no skin file'}."
    )
    title = f"{description.name}: {model.n} joints, end-effector {description.ee_body}"
    console = Console(highlight=False)
    show(console, [TextTable(title, header, tuple(rows), note, 1)])
    console.print(f"In order: {folder}.", markup=False, soft_wrap=True)
