"""The arms that can be named: those of the package, and folders."""

from pathlib import Path

from pretouch.errors import RobotModelError
from pretouch.robot.description import RobotDescription, fr3, panda
from pretouch.robot.description_file import load_description

ROBOTS = {"panda": panda, "fr3": fr3}
"""Those that come with the package."""


def is_shipped(arm: RobotDescription) -> bool:
    """Whether an arm's model is one that comes with the package: a Panda or an FR3."""
    return arm.mjcf in (panda().mjcf, fr3().mjcf)


def robot_named(name: str) -> RobotDescription:
    """Return the description of an arm, by its name or by the folder or robot.toml that it was imported to.

    Raises RobotModelError where there is neither, or where the file is wrong.
    """
    if name in ROBOTS:
        return ROBOTS[name]()
    if not Path(name).exists():
        raise RobotModelError(
            f"There is no arm {name!r}: take one of {', '.join(ROBOTS)}, or a folder that"
            " `pretouch robot import FILE --out FOLDER` wrote."
        )
    return load_description(name)
