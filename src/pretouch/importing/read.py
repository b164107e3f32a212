"""Reading of a robot's file, whichever of the two kinds it is."""

from pathlib import Path
from xml.etree import ElementTree as ET

from pretouch.errors import RobotModelError
from pretouch.importing.mjcf import read_mjcf
from pretouch.importing.source import Source
from pretouch.importing.urdf import read_urdf


def read_source(file: Path, folders: tuple[Path, ...] = ()) -> Source:
    """Read a robot from a URDF or MJCF file. What is wrong with it is a RobotModelError that names it.

    Args:
        file: the file.
        folders: that hold the ROS packages a URDF names.
    """
    root = _root(file)
    if root.tag == "mujoco":
        return read_mjcf(file)
    if root.tag == "robot":
        try:
            return read_urdf(root, file, folders)
        except RobotModelError as error:
            raise RobotModelError(f"{error} (in {file})") from error
    raise RobotModelError(
        f"The file {file} starts with <{root.tag}>: give a URDF (<robot>) or an MJCF (<mujoco>) file."
    )


def _root(file: Path) -> ET.Element:
    try:
        if file.exists() and not file.is_file():  # as a pipe or a device, which may have no end
            raise RobotModelError(f"{file} is no file: give a URDF or MJCF file.")
        data = file.read_bytes()
    except OSError as error:
        raise RobotModelError(f"The file {file} cannot be read: {error.strerror}: give a URDF or MJCF file.") from error
    try:
        root = ET.fromstring(data)  # noqa: S314  the user's own file
    except (ET.ParseError, ValueError, LookupError) as error:
        raise RobotModelError(f"The file {file} is not valid XML: {error}.") from error
    if "xacro" in str(root.tag) or any("xacro" in str(child.tag) for child in root):
        raise RobotModelError(f"The file {file} is a xacro template: make a URDF of it by `xacro {file.name}` first.")
    return root
