"""Contact-anticipating control for robot arms with onboard proximity sensing.

What a program of your own needs is here by name and loaded when it is asked for: `import pretouch` loads nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.2.0"

if TYPE_CHECKING:
    from pretouch import loop as loop
    from pretouch import realtime as realtime
    from pretouch.contact.admittance import Admittance as Admittance
    from pretouch.contact.decaying_velocity import DecayingVelocity as DecayingVelocity
    from pretouch.contact.detector import Body as Body
    from pretouch.contact.detector import Detection as Detection
    from pretouch.contact.detector import Detector as Detector
    from pretouch.contact.detector import Sample as Sample
    from pretouch.contact.moving_thresholds import MovingThresholds as MovingThresholds
    from pretouch.contact.reaction import Reaction as Reaction
    from pretouch.contact.sequential_test import SequentialTest as SequentialTest
    from pretouch.contact.window import add_force as add_force
    from pretouch.contact.window import window_init as window_init
    from pretouch.control.approach_restriction import ApproachRestriction as ApproachRestriction
    from pretouch.control.joint_box import joint_box as joint_box
    from pretouch.control.joint_box import joint_limits as joint_limits
    from pretouch.control.path import Circle as Circle
    from pretouch.control.path import WayPoints as WayPoints
    from pretouch.control.path import line as line
    from pretouch.control.restriction import approach_rows as approach_rows
    from pretouch.controller import Controller as Controller
    from pretouch.controller import ControllerState as ControllerState
    from pretouch.errors import PretouchError as PretouchError
    from pretouch.errors import RecordingError as RecordingError
    from pretouch.loop import Cycle as Cycle
    from pretouch.loop import MonotonicClock as MonotonicClock
    from pretouch.loop import Recorder as Recorder
    from pretouch.params import WindowParams as WindowParams
    from pretouch.perception.closest import closest_points as closest_points
    from pretouch.perception.closest import no_obstacles as no_obstacles
    from pretouch.perception.scene_filter import Fixtures as Fixtures
    from pretouch.perception.scene_filter import no_fixtures as no_fixtures
    from pretouch.profiles import PROFILES as PROFILES
    from pretouch.profiles import Profile as Profile
    from pretouch.profiles import at_rate as at_rate
    from pretouch.profiles import profile as profile
    from pretouch.recording.last_seconds import LastSeconds as LastSeconds
    from pretouch.recording.reader import open_recording as open_recording
    from pretouch.recording.verify import verify as verify
    from pretouch.recording.writer import Recording as Recording
    from pretouch.robot.description import RobotDescription as RobotDescription
    from pretouch.robot.description import fr3 as fr3
    from pretouch.robot.description import panda as panda
    from pretouch.robot.model import RobotModel as RobotModel
    from pretouch.sensing.skin import Skin as Skin
    from pretouch.sensing.skin import load_skin as load_skin
    from pretouch.sensing.skin import paper_skin as paper_skin
    from pretouch.sensing.unit import SensorUnit as SensorUnit
    from pretouch.types import Contact as Contact
    from pretouch.types import ControlStep as ControlStep
    from pretouch.types import Inputs as Inputs
    from pretouch.types import Mode as Mode
    from pretouch.types import Obstacles as Obstacles
    from pretouch.types import RangeReadings as RangeReadings
    from pretouch.types import RangeStatus as RangeStatus
    from pretouch.types import RobotState as RobotState
    from pretouch.types import SeenPoints as SeenPoints
    from pretouch.types import Thresholds as Thresholds

_PLACES = {
    "contact.admittance": ("Admittance",),
    "contact.decaying_velocity": ("DecayingVelocity",),
    "contact.reaction": ("Reaction",),
    "contact.detector": ("Body", "Detection", "Detector", "Sample"),
    "contact.moving_thresholds": ("MovingThresholds",),
    "contact.sequential_test": ("SequentialTest",),
    "contact.window": ("add_force", "window_init"),
    "control.joint_box": ("joint_box", "joint_limits"),
    "control.path": ("Circle", "WayPoints", "line"),
    "control.approach_restriction": ("ApproachRestriction",),
    "control.restriction": ("approach_rows",),
    "controller": ("Controller", "ControllerState"),
    "errors": ("PretouchError", "RecordingError"),
    "loop": ("Cycle", "MonotonicClock", "Recorder"),
    "params": ("WindowParams",),
    "perception.closest": ("closest_points", "no_obstacles"),
    "perception.scene_filter": ("Fixtures", "no_fixtures"),
    "profiles": ("PROFILES", "Profile", "at_rate", "profile"),
    "recording.last_seconds": ("LastSeconds",),
    "recording.reader": ("open_recording",),
    "recording.verify": ("verify",),
    "recording.writer": ("Recording",),
    "robot.description": ("RobotDescription", "fr3", "panda"),
    "robot.model": ("RobotModel",),
    "sensing.skin": ("Skin", "load_skin", "paper_skin"),
    "sensing.unit": ("SensorUnit",),
    "types": (
        "Contact",
        "ControlStep",
        "Inputs",
        "Mode",
        "Obstacles",
        "RangeReadings",
        "RangeStatus",
        "RobotState",
        "SeenPoints",
        "Thresholds",
    ),
}
_PLACE = {name: f"pretouch.{module}" for module, names in _PLACES.items() for name in names}


_MODULES = ("loop", "realtime")

__all__ = sorted([*_PLACE, *_MODULES])

if not TYPE_CHECKING:  # a type checker takes the imports above, and knows what is not there

    def __getattr__(name: str) -> object:
        if name in _MODULES:
            return import_module(f"pretouch.{name}")
        if name not in _PLACE:
            raise AttributeError(f"module 'pretouch' has no attribute {name!r}")
        found = globals()[name] = getattr(import_module(_PLACE[name]), name)
        return found

    def __dir__() -> list[str]:
        return [*__all__, "__version__"]
