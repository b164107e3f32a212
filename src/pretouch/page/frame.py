"""What a page shows: the world that stands still, and one instant in it."""

from dataclasses import dataclass

import numpy as np

from pretouch.control.path import Path
from pretouch.profiles import Profile
from pretouch.recording.simulation import KnownBox
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, ControlStep, FloatArray, Inputs


@dataclass(frozen=True)
class World:
    """What stays the same from one frame to the next, until a person changes it: then there is another `World`."""

    model: RobotModel
    skin: Skin
    path: Path
    profile: Profile
    boxes: tuple[KnownBox, ...]
    hand_radius: float | None
    """Radius of the person's hand [m], None without one."""
    floor_height: float
    """[m], base frame."""

    @property
    def units_in_use(self) -> tuple[str, ...]:
        """Ids of the units whose readings the controller uses, in the skin's order; () of a blind one."""
        return self.skin.ids if self.profile.perception else ()


@dataclass(frozen=True, slots=True)
class Frame:
    """One instant to be drawn."""

    step: ControlStep
    hand: FloatArray | None
    """(3,) centre of the person's hand [m], base frame."""
    hand_target: FloatArray | None
    """(3,) where the mouse asks the hand to be [m], base frame."""
    true_force: FloatArray | None
    """(3,) contact force on the arm by everything else [N], base frame; None where only the estimate is known."""
    true_point: FloatArray | None = None
    """(3,) where that force acts [m], base frame; None where it is not known."""
    age: FloatArray | None = None
    """(K,) time since the newest reading of each unit [s]; None where it is not known."""
    inputs: Inputs | None = None
    """What the step was given, a commander's wish included; None where it is not known."""

    def late(self, limit: float) -> BoolArray:
        """Which units (K,) have given no reading for longer than a time [s]."""
        if self.age is None:
            return np.zeros(len(self.step.range_distance), dtype=np.bool_)
        return self.age > limit
