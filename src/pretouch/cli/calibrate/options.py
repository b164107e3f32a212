"""What can be said after `pretouch skin calibrate`, and which of it goes together."""

from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from typing import Any, Literal

from pretouch.errors import CalibrationError
from pretouch.hardware.udp import HOST, PORT


@dataclass(frozen=True)
class RecordingOptions:
    """From what was recorded while the arm made a calibration motion."""

    recording: str = ""
    """Recording of the units, by `pretouch skin monitor --record`, or of a run with real units."""
    joints: str = ""
    """Joint states, if they are not in the recording: a CSV file (time_s,q1_rad,...), an MCAP file or a bag. Its clock
    may be any."""
    topic: str = ""
    """Topic of the joint states in that file, if there are several."""


@dataclass(frozen=True)
class LiveOptions:
    """Here and now: the arm makes the motion, all is recorded, and the units are calibrated from that."""

    robot: str = ""
    """The arm to move: `simulated`, with simulated units."""
    keys: str = ""
    """File of the units' keys; with a simulated arm, one that is not there is made."""
    units_host: str = HOST
    """Address at which units are heard; real ones need 0.0.0.0, which is every address of this machine."""
    units_port: int = PORT
    """UDP port at which units are heard."""
    record: str = ""
    """Recording to write; by default a new one beside the skin file."""
    yes: bool = False
    """Do not ask before the arm moves."""


@dataclass(frozen=True)
class MotionOptions:
    """The motion: it begins and ends in the arm's ready posture."""

    duration: float = 60.0
    """How long it takes [s], at most 90."""
    variant: int = 0
    """Another number, another motion: if there is no room for this one."""
    reach: float = 0.5
    """Furthest from its position at the start [rad] a joint is where the arm stands: less, and the arm needs less room.
    Swings about these postures go beyond, by some 0.4 rad."""
    speed: float = 0.7
    """Largest speed of any part of the arm [m/s]."""
    clearance: float = 0.03
    """Distance kept between parts of the arm, and from the floor [m]."""
    floor: float = 0.0
    """Height of what is below the arm, base frame [m]."""


@dataclass(frozen=True)
class Calibrate:
    """Find where each unit sits, from its IMU and the joint positions of the moving arm, and write the skin file.

    The exit code is 1 if a unit was refused.
    """

    recorded: RecordingOptions = field(default_factory=RecordingOptions)
    live: LiveOptions = field(default_factory=LiveOptions)
    motion: MotionOptions = field(default_factory=MotionOptions)
    plan: str = ""
    """CSV file to write the motion to, for your own driver (time_s, q1_rad to qn_rad, qd1_rad_s to qdn_rad_s),
    instead of making it."""
    skin: str = ""
    """Skin file that names the units and their links as you believe them, to be checked; without it, links are found.
    A simulated arm has its units there, without it the seven that come with the package."""
    out: str = ""
    """Skin file to write: places and how well they are known. Refused units are as in --skin, or left out."""
    json: str = ""
    """File for all numbers."""
    replace: bool = False
    """Write over files that are there."""
    arm: Literal["panda", "fr3"] = "panda"
    """The arm."""
    seed: int = 0
    """Decides all that is random in a simulation."""

    def run(self) -> int:
        """Calibrate, and show and write the answer."""
        from pretouch.cli.calibrate.command import calibrate_skin

        return calibrate_skin(self, way_of(self))


Way = Literal["recording", "plan", "robot"]
_ANY = {"arm"}
_MOTION = {"duration", "variant", "reach", "speed", "clearance", "floor"}
_OPTIONS: dict[Way, set[str]] = {
    "recording": {"recording", "joints", "topic", "skin", "out", "json", "replace"} | _ANY,
    "plan": {"plan", "replace"} | _MOTION | _ANY,
    "robot": {"robot", "keys", "units_host", "units_port", "record", "yes", "skin", "out", "json", "replace", "seed"}
    | _MOTION
    | _ANY,
}


def way_of(command: Calibrate) -> Way:
    """Return the way to calibrate; a CalibrationError where options say none, two, or do not go together."""
    given = {name for name, value, default in _leaves(command) if value != default}
    ways = [way for way in _OPTIONS if way in given]
    if not ways:
        raise CalibrationError(
            "Nothing says what to calibrate from: give --recording FILE, --plan FILE, or --robot ARM."
        )
    if len(ways) > 1:
        raise CalibrationError(f"{' and '.join(map(_flag, ways))} are given: choose one of them.")
    odd = sorted(given - _OPTIONS[ways[0]])
    if odd:
        raise CalibrationError(
            f"{', '.join(map(_flag, odd))} {'does' if len(odd) == 1 else 'do'} not go with {_flag(ways[0])}:"
            f" leave {'it' if len(odd) == 1 else 'them'} out."
        )
    return ways[0]


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _leaves(options: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, value and default of each single option."""
    for one in fields(options):
        value = getattr(options, one.name)
        if is_dataclass(value):
            yield from _leaves(value)
        else:
            yield one.name, value, _default(one)


def _default(one: Field[Any]) -> Any:
    return None if one.default is MISSING else one.default
