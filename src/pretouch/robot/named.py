"""The arms that can be named: those of the package, and folders."""

import re
from pathlib import Path

from pretouch.errors import RobotModelError
from pretouch.robot.description import RobotDescription, fr3, panda
from pretouch.robot.description_file import load_description

ROBOTS = {"panda": panda, "fr3": fr3}
"""Those that come with the package."""
_DESCRIPTION = re.compile(r"[a-z][a-z0-9_]*_description")


def is_description(name: str) -> bool:
    """Whether a name is no file's or folder's, but like those of the package robot_descriptions, as ur5_description."""
    return _DESCRIPTION.fullmatch(name) is not None and not Path(name).exists()


def is_shipped(arm: RobotDescription) -> bool:
    """Whether an arm's model is one that comes with the package: a Panda or an FR3."""
    return arm.mjcf in (panda().mjcf, fr3().mjcf)


def robot_named(name: str) -> RobotDescription:
    """Return the description of an arm, by its name or by the folder or robot.toml that it was imported to.

    Raises RobotModelError where there is neither, or where the file is wrong.
    """
    if name in ROBOTS:
        return ROBOTS[name]()
    if is_description(name):
        raise RobotModelError(
            f"There is no arm {name!r} yet: import it first by `pretouch robot import {name} --out"
            f" {name.split('_')[0]}`, and name that folder."
        )
    if not Path(name).exists():
        raise RobotModelError(
            f"There is no arm {name!r}: take one of {', '.join(ROBOTS)}, or a folder that"
            " `pretouch robot import` wrote."
        )
    return load_description(name)
