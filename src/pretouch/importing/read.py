"""Reading of a robot's file, whichever of the two kinds it is."""

from pathlib import Path
from xml.etree import ElementTree as ET

from pretouch.errors import RobotModelError
from pretouch.importing.mjcf import read_mjcf
from pretouch.importing.source import Source
from pretouch.importing.urdf import read_urdf
from pretouch.robot.mjcf_check import xml_tree

_LARGEST_FILE = 50_000_000
"""[bytes]"""
_MOST_LINKS = 1000
_MOST_ELEMENTS = 100_000
"""Of one file: real robots have some 1000; each takes about 0.5 kB."""


def read_source(file: Path, folders: tuple[Path, ...] = ()) -> Source:
    """Read a robot from a URDF or MJCF file. What is wrong with it is a RobotModelError that names it.

    Args:
        file: the file.
        folders: that hold the ROS packages a URDF names.
    """
    root = _root(file)
    count = len(root.findall("link"))
    if root.tag == "robot" and count > _MOST_LINKS:
        raise RobotModelError(f"The file {file} has {count} links: give at most {_MOST_LINKS}.")
    if root.tag == "mujoco":
        _check_included(root, file)
        return read_mjcf(file)
    if root.tag == "robot":
        try:
            return read_urdf(root, file, folders)
        except RobotModelError as error:
            raise RobotModelError(f"{error} (in {file})") from error
    raise RobotModelError(
        f"The file {file} starts with <{root.tag}>: give a URDF (<robot>) or an MJCF (<mujoco>) file."
    )


def _check_included(root: ET.Element, file: Path) -> None:
    """Refuse an MJCF file that includes one from outside its folder: the author would choose what is read here."""
    folder = file.parent.resolve()
    waiting, seen = [root], set[Path]()
    while waiting:
        for element in waiting.pop().iter():
            given = element.get("file") if element.tag in ("include", "model") else None
            other = folder / (given or file.name)
            if given and (Path(given).is_absolute() or not other.resolve().is_relative_to(folder)):
                raise RobotModelError(f"The file {file} includes {given}, outside its folder: put a copy beside it.")
            if given and other not in seen and other.is_file():
                seen.add(other)
                waiting.append(_root(other))


def _root(file: Path) -> ET.Element:
    try:
        if file.exists() and not file.is_file():  # as a pipe or a device, which may have no end
            raise RobotModelError(f"{file} is no file: give a URDF or MJCF file.")
        if file.stat().st_size > _LARGEST_FILE:
            raise RobotModelError(
                f"The file {file} is larger than {_LARGEST_FILE // 10**6} MB: give a robot description without embedded"
                " data."
            )
        data = file.read_bytes()
    except OSError as error:
        raise RobotModelError(f"The file {file} cannot be read: {error.strerror}: give a URDF or MJCF file.") from error
    try:
        root = xml_tree(data, _MOST_ELEMENTS)
    except RobotModelError as error:
        raise RobotModelError(f"{error} (in {file})") from error
    if "xacro" in str(root.tag) or any("xacro" in str(child.tag) for child in root):
        raise RobotModelError(f"The file {file} is a xacro template: make a URDF of it by `xacro {file.name}` first.")
    return root
