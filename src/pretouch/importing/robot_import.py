"""Import of a robot's file as the folder of an arm, which the rest of the package takes."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.arm_file import arm_file
from pretouch.importing.capsules import MOST, LinkBody, bodies_of
from pretouch.importing.chain import arm_of, limits_of
from pretouch.importing.read import read_robot
from pretouch.importing.ready import Ready, check_posture, proposed, rated
from pretouch.robot.description import FILE, RobotDescription, description_text
from pretouch.robot.model import RobotModel

MJCF = "arm.xml"


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Facts that a robot's file does not contain: options of `pretouch robot import`."""

    ee: str = ""
    """Link whose origin is the end-effector; by default the most likely one."""
    name: str = ""
    """Name of the arm; by default the file's."""
    package_path: tuple[Path, ...] = ()
    """Folders that hold ROS packages."""
    qd_max: tuple[float, ...] = ()
    """Joint velocity limits [rad/s]: one for all, or one for each."""
    qdd_max: tuple[float, ...] = ()
    """Joint acceleration limits [rad/s^2]."""
    tau_max: tuple[float, ...] = ()
    """Joint torque limits [Nm]."""
    ready: tuple[float, ...] = ()
    """Usual posture to start from [rad]; by default one is searched for."""
    capsules: int = MOST
    """Largest number of capsules per link."""
    cover: bool = False
    """Enlarge the capsules until no surface sticks out of them: the arm then keeps more distance than necessary."""


@dataclass(frozen=True, eq=False)
class Imported:
    """An arm that was read, and how good what stands for it is."""

    mjcf_text: str
    model: RobotModel
    """The MJCF file of its description has the name `MJCF` and is gone; `mjcf_text` is what was in it."""
    bodies: tuple[LinkBody, ...]
    ready: Ready
    remarks: tuple[str, ...]
    """Assumptions and omissions, a sentence each."""


def import_robot(file: Path, options: ImportOptions) -> Imported:
    """Read an arm, fit capsules, and propose what the file does not hold. Foreseeable misuse is a RobotModelError."""
    if not 1 <= options.capsules <= 10:
        raise RobotModelError(f"--capsules is {options.capsules}: give 1 to 10 for one link.")
    robot = read_robot(file, options.package_path)
    arm = arm_of(robot, options.ee)
    limits = limits_of(arm, options.qd_max, options.qdd_max, options.tau_max)
    if options.ready:
        check_posture(np.array(options.ready), limits.q_min, limits.q_max, "--ready")
    bodies, name = bodies_of(arm, options.capsules, options.cover), options.name or robot.name
    text = arm_file(name, arm, limits, bodies)
    with tempfile.TemporaryDirectory(prefix="pretouch-") as folder:
        mjcf = Path(folder) / MJCF
        mjcf.write_text(text, encoding="utf-8")
        description = RobotDescription(
            name,
            mjcf,
            robot.links[arm.ee].name,
            limits.qd_max,
            limits.qdd_max,
            limits.tau_max,
            (limits.q_min + limits.q_max) / 2,
            f"imported from {file.name}",
        )
        model = RobotModel(description)
        ready = rated(model, np.array(options.ready)) if options.ready else proposed(model, robot.remarks)
        model = RobotModel(replace(description, q_ready=ready.q))
    return Imported(text, model, bodies, ready, tuple(robot.remarks))


def check_free(folder: Path) -> None:
    """Raise RobotModelError if a folder is there."""
    if folder.exists() or folder.is_symlink():
        raise RobotModelError(f"The folder {folder} exists already: give another --out, or remove it.")


def write_folder(imported: Imported, folder: Path) -> None:
    """Write an arm's folder; one that is there is a RobotModelError."""
    check_free(folder)
    try:
        folder.mkdir(parents=True)
        (folder / MJCF).write_text(imported.mjcf_text, encoding="utf-8")
        (folder / FILE).write_text(description_text(imported.model.description), encoding="utf-8")
    except OSError as error:
        raise RobotModelError(
            f"The folder {folder} cannot be written: {error.strerror}: give another --out."
        ) from error
