"""What a live session begins with."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pretouch.checks import Check, Checked
from pretouch.profiles import PROFILES, Profile
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import HandSpec

PathName = Literal["circle", "line"]
"""The paper's two paths; the line is run there and back."""

ObjectName = Literal["none", "board -y", "board +y"]
"""What stands in the arm's way: nothing, or the static experiment's board on one side."""

Stiffness = Annotated[float, Check(low=3_000.0, high=150_000.0)]
"""Of a contact with the arm [N/m]. On a softer one a hand that pushes hard sinks through a thin link; a stiffer one of
a hand of 0.6 kg swings too quickly for physics in steps of 1 ms."""


@dataclass(frozen=True)
class Faults(Checked):
    """What is wrong with the sensor units."""

    silenced: frozenset[str] = frozenset()
    """Ids of the units that no longer send."""
    noise_factor: Annotated[float, Check(low=0.0, high=20.0)] = 1.0
    """Factor on the standard deviation of the readings."""
    latency_s: Annotated[float, Check(low=0.0, high=1.0)] = 0.0
    """Time by which readings arrive later than they do anyway [s]."""


@dataclass(frozen=True)
class LiveSettings(Checked):
    """What a live session begins with, and begins again with at a reset."""

    profile: Profile = field(default_factory=lambda: PROFILES["paper"])
    """Parameters of the controller, restrictions and speed included."""
    path: PathName = "circle"
    """Path of the end-effector."""
    object: ObjectName = "none"
    """What stands in its way."""
    stiffness: Stiffness = HandSpec.stiffness
    """Stiffness of what the arm can touch, the person's hand and the object [N/m]."""
    faults: Faults = field(default_factory=Faults)
    """What is wrong with the sensor units."""
    seed: Annotated[int, Check(low=0)] = 0
    """Decides the arm's errors and all noise."""
    plant: PlantParams = field(default_factory=PlantParams)
    """The kind of simulated arm."""
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    """How simulated units err without faults."""
    hand_start: tuple[float, float, float] = (1.0, 0.5, 0.3)
    """Where the person's hand begins [m], base frame: in view, and clear of both paths; moved aside if that is inside
    something."""
