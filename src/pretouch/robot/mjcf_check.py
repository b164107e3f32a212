"""What an arm's XML may hold before anything is made of it: MuJoCo bounds neither the time nor the memory it takes.

MuJoCo compiles a model in C, where no signal reaches Python. What passes here takes it under a second, since none of
the elements left multiplies others or reads a file.
"""

from xml.etree import ElementTree as ET

from pretouch.errors import RobotModelError

LARGEST_MJCF = 1_000_000
"""[bytes] Ours have 10 kB."""
_MOST_ELEMENTS = 2000
"""An arm of 60 links with six capsules each has some 500; RobotModel takes memory by the square: 0.3 GB for so many."""
_MOST_JOINTS = 64
_ELEMENTS = frozenset({
    "mujoco", "compiler", "option", "flag", "statistic", "default", "worldbody", "frame", "body", "inertial", "joint",
    "geom", "site", "camera", "light", "asset", "material", "contact", "exclude", "actuator", "general", "motor",
    "position", "velocity", "keyframe", "key",
})  # fmt: skip
"""What describes an arm by bodies, joints and simple shapes; `pretouch robot import` writes a part of it."""
_ATTRIBUTES = frozenset({"user", "nsample", "actdim"})
"""Each makes arrays as wide as one element asks for, for all elements."""
_MUSCLE = "muscle"
"""A kind of actuator whose range MuJoCo finds by simulation."""


def check_mjcf(data: bytes) -> None:
    """Refuse, by a RobotModelError, an MJCF file with what an arm's model does not need or with too much of it."""
    if len(data) > LARGEST_MJCF:
        raise RobotModelError(f"The MJCF is larger than {LARGEST_MJCF} bytes: {_WAY_OUT}.")
    joints = 0
    for element in xml_tree(data, _MOST_ELEMENTS, "utf-8").iter():  # as MuJoCo reads it, whatever the file declares
        joints += element.tag == "joint"
        wide = _ATTRIBUTES.intersection(element.attrib)
        if element.tag not in _ELEMENTS:
            raise RobotModelError(f"The MJCF has an element <{element.tag[:50]}>: {_WAY_OUT}.")
        if wide or _MUSCLE in element.attrib.values():
            what = f"the attribute {min(wide)}" if wide else f"a {_MUSCLE}"
            raise RobotModelError(f"The MJCF has <{element.tag}> with {what}: {_WAY_OUT}.")
    if joints > _MOST_JOINTS:
        raise RobotModelError(f"The MJCF has {joints} joints: give at most {_MOST_JOINTS}.")


_WAY_OUT = "leave it out, or make the arm anew of its source by `pretouch robot import`"


class _Tree(ET.TreeBuilder):
    """Builds a tree of so many elements at most, without a document type, whose entities could grow or read files."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._given = self._left = most

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:
        """Take the begin of an element."""
        self._left -= 1
        if self._left < 0:
            raise RobotModelError(
                f"The file has more than {self._given} elements: leave out what the arm does not need."
            )
        return super().start(tag, attrs)

    def doctype(self, _name: str, _public: str | None, _system: str | None) -> None:
        """Refuse a document type: a robot needs none."""
        raise RobotModelError("The file has a document type (<!DOCTYPE>): leave it out.")


def xml_tree(data: bytes, most: int, encoding: str | None = None) -> ET.Element:
    """Return the root of an XML file with so many elements at most, read in this encoding or the one that it names.

    What is wrong with it is a RobotModelError.
    """
    try:
        return ET.fromstring(data, ET.XMLParser(target=_Tree(most), encoding=encoding))  # noqa: S314  bounded by _Tree
    except RobotModelError:
        raise
    except (ET.ParseError, ValueError, LookupError) as error:
        raise RobotModelError(f"The file is not valid XML: {error}.") from error
