"""The arms that `pretouch run` moves: the product's own, and those that others add in the group `pretouch.arms`.

An arm is a frozen dataclass: its fields are the options that it alone has, and their docstrings are the help.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

from pretouch import extras, plugins
from pretouch.errors import PluginError

if TYPE_CHECKING:
    from pretouch.controller import Controller
    from pretouch.desired import Desired
    from pretouch.loop import Cycle
    from pretouch.ports import Arm, SkinPort
    from pretouch.profiles import Profile
    from pretouch.robot.description import RobotDescription
    from pretouch.robot.model import RobotModel
    from pretouch.sensing import skin
    from pretouch.session.memory import Identity
    from pretouch.session.push import Direction
    from pretouch.types import FloatArray, RobotState

# an arm's options are defined without what only moving it needs

GROUP = "pretouch.arms"
DEFAULT = "simulated"
"""The arm where none is named."""
_OWN = {"simulated": "pretouch.arms.simulated:Simulated", "franka": "pretouch.arms.franka:Franka"}
_ELSEWHERE = {"ros2": extras.ROS2}
"""Distributions of this project that have further arms."""


@dataclass(frozen=True)
class ArmSetup:
    """Arguments that open an arm."""

    name: str
    """Its model as it was named: `panda`, `fr3`, or the folder of an imported arm."""
    model: "RobotModel"
    """Its model; for another thread, make one from `model.description`."""
    skin: "skin.Skin"
    """The sensor units on it; none with --no-skin."""
    units: bool
    """True if the arm is to bring them: they are there, and do not come over the network."""
    profile: "Profile"
    """Parameters of the controller that moves it."""
    start: "Callable[[], FloatArray]"
    """Gives joint positions (n,) [rad] at which a simulated arm begins."""
    floor: float
    """Height of what is below the arm, base frame [m]."""
    priority: int | None
    """Real-time priority of the control loop; None: the process keeps its own."""
    yes: bool
    """True if a person has allowed beforehand what would otherwise be asked."""


class Output(Protocol):
    """Receiver of each control step beside the recorder."""

    def record(self, cycle: "Cycle") -> None:
        """Take one turn of the loop."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for a person, a sentence each."""
        ...


@dataclass(frozen=True)
class OpenedArm:
    """An arm that can be read, and what it brings."""

    arm: "Arm"
    identity: "Identity | None" = None
    """Identity by which its confirmed force sign is remembered; None: it is not remembered."""
    skin: "SkinPort | None" = None
    """Its sensor units, a `NetworkSkin` where their health is to be judged; None: it brings none."""
    push: "Callable[[Direction], None]" = lambda _: None
    """Called as a person is asked to push: a simulated one does."""
    notes: Callable[[], tuple[str, ...]] = lambda: ()
    """Remarks on the connection so far, a sentence each."""
    output: "Callable[[Controller], AbstractContextManager[Output | None]]" = lambda _: nullcontext()
    """Opens what else is told of each control step."""
    free_motion_id: str = ""
    """Name under which its free motion is remembered; '': the arm's name."""
    left_out: Callable[[], float] = lambda: 0.0
    """Time that this machine was too slow to simulate it so far [s]."""
    measured: "Callable[[], RobotState] | None" = None
    """Its newest state by the clock of its units, where that of `arm` may be stamped otherwise."""
    commander: "Callable[[], Desired | None] | None" = None
    """Commander that the arm follows in place of the path; see `loop.Options.desired`."""
    announced: str = ""
    """Announcement of a commander's motion, printed before the arm moves."""

    def __post_init__(self) -> None:
        if self.commander and not self.announced:
            raise PluginError(f"{self.arm.name} has a commander: say in OpenedArm.announced what that lets the arm do.")


class ArmOptions(ABC):
    """Base of an arm's options."""

    simulated: ClassVar[bool] = False
    """True if it is no real one: the floor is that of the simulated room, and assumptions on the arm are said."""
    brings_units: ClassVar[bool] = False
    """True if it can bring the sensor units of a skin; otherwise they come over the network."""

    @property
    def commanded(self) -> bool:
        """True if it brings a commander, so that no path is followed."""
        return False

    def described(self, description: "RobotDescription") -> "RobotDescription":
        """Return what a controller is to know of the arm; by default all of its model."""
        return description

    def check(self, setup: ArmSetup) -> None:
        """Raise an error for what does not fit together, before anything is compiled or opened."""
        return

    @abstractmethod
    def open(self, setup: ArmSetup) -> AbstractContextManager[OpenedArm]:
        """Connect to the arm for the duration of a context; what stands in the way is a RobotError."""


def arm_names() -> tuple[str, ...]:
    """Return the names of all arms that are installed: the product's, then others."""
    return (*_OWN, *(name for name in plugins.names(GROUP) if name not in _OWN))


def arm_class(name: str) -> type[ArmOptions]:
    """Return the class of an arm's options; a PluginError for a name that is none, with the way out."""
    if name in _OWN:
        module, _, member = _OWN[name].partition(":")
        return cast(type[ArmOptions], getattr(import_module(module), member))
    if name in plugins.names(GROUP):
        options: Any = plugins.load(GROUP, name)
        if not (isinstance(options, type) and issubclass(options, ArmOptions)):
            raise PluginError(
                f"The entry point of the arm {name!r} is not a subclass of pretouch.arms.ArmOptions: uninstall the"
                " distribution that provides it, or correct it."
            )
        return options
    if name in _ELSEWHERE:
        extra = _ELSEWHERE[name]
        raise PluginError(
            f"The arm {name!r} is in the distribution {extra.distribution}, which is not installed: run {extra.command}"
        )
    near = get_close_matches(name, arm_names(), 1)
    way_out = f"perhaps {near[0]}" if near else f"choose from {', '.join(arm_names())}"
    raise PluginError(f"No arm to move is called {name!r}: {way_out}.")
