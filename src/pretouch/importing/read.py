"""Reading of a robot's file, whichever of the two kinds it is."""

from pathlib import Path
from xml.etree import ElementTree as ET

from pretouch.errors import RobotModelError
from pretouch.importing.mjcf import read_mjcf
from pretouch.importing.source import Source
from pretouch.importing.urdf import read_urdf

_LARGEST_FILE = 50_000_000
"""[bytes]"""
_MOST_LINKS = 1000


def read_source(file: Path, folders: tuple[Path, ...] = ()) -> Source:
    """Read a robot from a URDF or MJCF file. What is wrong with it is a RobotModelError that names it.

    Args:
        file: the file.
        folders: that hold the ROS packages a URDF names.
    """
    root = _root(file)
    if root.tag == "mujoco":
        source = read_mjcf(file)
    elif root.tag == "robot":
        try:
            source = read_urdf(root, file, folders)
        except RobotModelError as error:
            raise RobotModelError(f"{error} (in {file})") from error
    else:
        raise RobotModelError(
            f"The file {file} starts with <{root.tag}>: give a URDF (<robot>) or an MJCF (<mujoco>) file."
        )
    if len(source.links) > _MOST_LINKS:
        raise RobotModelError(f"The file {file} has {len(source.links)} links: give at most {_MOST_LINKS}.")
    return source


def _root(file: Path) -> ET.Element:
    try:
        if file.stat().st_size > _LARGEST_FILE:
            raise RobotModelError(
                f"The file {file} is larger than {_LARGEST_FILE // 10**6} MB: give a robot description without embedded"
                " data."
            )
        data = file.read_bytes()
    except OSError as error:
        raise RobotModelError(f"The file {file} cannot be read: {error.strerror}: give a URDF or MJCF file.") from error
    try:
        root = ET.fromstring(data, ET.XMLParser(target=_NoEntities()))  # noqa: S314  its entities are refused
    except RobotModelError as error:
        raise RobotModelError(f"{error} (in {file})") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise RobotModelError(f"The file {file} is not valid XML: {error}.") from error
    if "xacro" in str(root.tag) or any("xacro" in str(child.tag) for child in root):
        raise RobotModelError(f"The file {file} is a xacro template: make a URDF of it by `xacro {file.name}` first.")
    return root


class _NoEntities(ET.TreeBuilder):
    """Refuses a document type: a robot needs none, and entities in it could grow without bounds or read files."""

    def doctype(self, _name: str, _public: str | None, _system: str | None) -> None:
        raise RobotModelError("The file has a document type (<!DOCTYPE>): leave it out.")
