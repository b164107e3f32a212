"""The simulated gripper: two fingers, the commands they follow, and what lies between them. Values, no clock."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum

from pretouch.errors import ParameterError

MAX_WIDTH_M = 0.08
"""Distance between the opened fingers of a Franka Hand [m], by its data sheet."""
_FASTEST_M_S = 0.1
"""Each finger moves at up to 50 mm/s, by the same: so fast does the distance change [m/s]."""
_HEAVIEST_KG = 3.0
"""Payload of the Panda and the FR3, by their data sheets [kg]."""


class Outcome(IntEnum):
    """Outcome of a command, as answers number it."""

    SUCCESS = 0
    FAIL = 1
    UNSUCCESSFUL = 2
    ABORTED = 3


@dataclass(frozen=True, slots=True)
class GripperObject:
    """The thing between the fingers: they do not close any further than it is wide."""

    width: float
    """[m]"""
    mass: float
    """[kg]"""


def object_of(text: str) -> GripperObject:
    """Read WIDTH:KG."""
    try:
        width, mass = map(float, text.split(":"))
    except ValueError:
        width = mass = math.nan
    if not (0 < width < MAX_WIDTH_M and 0 < mass <= _HEAVIEST_KG):
        raise ParameterError(
            f"--object is {text!r}: give width and mass, such as 0.04:0.5 [m, kg], less than {MAX_WIDTH_M:g} m and up"
            f" to {_HEAVIEST_KG:g} kg."
        )
    return GripperObject(width, mass)


@dataclass(frozen=True, slots=True)
class Course:
    """A command on its way."""

    widths: tuple[float, ...]
    """Widths that the fingers move to, one after another [m]."""
    speed: float = _FASTEST_M_S
    """Rate of change of the distance between them [m/s]."""
    grasp: tuple[float, float] | None = None
    """If it is to grasp: an object is grasped if the fingers end between these widths [m], as the vendor defines."""


HOMING = Course((0.0, MAX_WIDTH_M))
"""The fingers close and open, as far as they can."""


def move_of(width: float, speed: float) -> Course | None:
    """Return a move to a width [m] at a speed [m/s], or None if there is no such move."""
    if not (0 <= width <= MAX_WIDTH_M and 0 < speed < math.inf):
        return None
    return Course((width,), min(speed, _FASTEST_M_S))


def grasp_of(width: float, inner: float, outer: float, speed: float, force: float) -> Course | None:
    """Return a grasp, or None if there is no such grasp.

    The fingers close until something stops them: tolerances inwards would mean nothing if they stopped at the width.

    Args:
        width: of the object [m].
        inner: how much narrower it may be [m].
        outer: how much wider [m].
        speed: of closing [m/s].
        force: on the object [N]; any is enough to hold it.
    """
    move, limits = move_of(width, speed), (inner, outer, force)
    if move is None or not all(0 <= value < math.inf for value in limits):
        return None
    return replace(move, widths=(0.0,), grasp=(width - inner, width + outer))


@dataclass(frozen=True, slots=True)
class Gripper:
    """The gripper at one instant. It has been homed."""

    object: GripperObject | None = None
    """Object between its fingers."""
    width: float = MAX_WIDTH_M
    """Distance between the fingers [m]."""
    grasped: bool = False
    """True if an object is grasped, by the distance alone, as the vendor defines it: a grasp whose tolerances include 0
    takes closed fingers for one."""
    course: Course | None = None
    """The command that it follows."""

    @property
    def load_kg(self) -> float:
        """Mass that the arm carries beyond the gripper itself [kg]."""
        return self.object.mass if self.grasped and self.object is not None else 0.0

    def step(self, seconds: float) -> tuple["Gripper", Outcome | None]:
        """Let time pass [s]; return what the gripper is then, and what became of a command that has ended.

        A step ends at the latest at the next of the command's widths; with infinite time it is always reached.
        """
        course = self.course
        if course is None:
            return self, None
        narrowest = 0.0 if self.object is None else self.object.width
        target, *later = course.widths
        goal, way = max(target, narrowest), course.speed * seconds
        there = abs(goal - self.width) <= way
        width = goal if there else self.width + math.copysign(way, goal - self.width)
        moved = replace(self, width=width, grasped=self.grasped and width <= narrowest)
        if not there:
            return moved, None
        if later:
            return replace(moved, course=replace(course, widths=tuple(later))), None
        if course.grasp is None:
            return replace(moved, course=None), Outcome.SUCCESS if width == target else Outcome.UNSUCCESSFUL
        least, most = course.grasp
        grasped = least < width < most
        return replace(moved, course=None, grasped=grasped), Outcome.SUCCESS if grasped else Outcome.UNSUCCESSFUL
