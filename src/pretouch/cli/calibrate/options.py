"""What can be said after `pretouch skin calibrate`, and which of it goes together."""

from collections.abc import Iterator, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Generic, Literal

from pretouch.arms import arm_class
from pretouch.cli.options import JsonFile, OptionalFile, split_arm
from pretouch.cli.run.options import A, UnitOptions
from pretouch.errors import CalibrationError, HardwareError


@dataclass(frozen=True)
class RecordingOptions:
    """From what was recorded while the arm made a calibration motion."""

    recording: OptionalFile = None
    """Recording of the units, by `pretouch skin monitor --record`."""
    joints: OptionalFile = None
    """Joint states, if they are not in the recording: a CSV file (time_s,q1_rad,...), an MCAP file or a bag, with any
    clock."""
    topic: str = ""
    """Topic of the joint states in that file, if there are several."""


@dataclass(frozen=True)
class MotionOptions:
    """The motion: it begins and ends in the arm's ready posture."""

    duration: float = 60.0
    """Duration [s], at most 90."""
    variant: int = 0
    """Number of the motion: choose another one if there is not enough space for this one."""
    reach: float = 0.5
    """Largest distance of a joint from its start position [rad] in the postures where the arm stands: less needs less
    space. Swings about these postures go about 0.4 rad further."""
    speed: float = 0.7
    """Largest speed of any part of the arm [m/s]."""
    clearance: float = 0.03
    """Distance kept between parts of the arm, and from the floor [m]."""
    floor: float = 0.0
    """Height of the floor below the arm, base frame [m]."""


@dataclass(frozen=True)
class Calibrate:
    """Find the pose of each unit, from its IMU and the joint positions of the moving arm, and write the skin file.

    `pretouch skin calibrate NAME` moves an arm itself: simulated, franka, or one that another distribution adds.
    The exit code is 1 if a unit was refused.
    """

    recorded: RecordingOptions = field(default_factory=RecordingOptions)
    motion: MotionOptions = field(default_factory=MotionOptions)
    plan: OptionalFile = None
    """CSV file to write the motion to, for your own driver (time_s, q1_rad to qn_rad, qd1_rad_s to qdn_rad_s),
    instead of running it."""
    skin: OptionalFile = None
    """Skin file with the units and their assumed links, which are checked; without it, links are identified."""
    out: OptionalFile = None
    """Skin file to write: places and how well they are known. Refused units are as in --skin, or left out."""
    json: JsonFile = None
    replace: bool = False
    """Overwrite existing files."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""

    @staticmethod
    def of_words(words: Sequence[str]) -> tuple[Any, Sequence[str], str]:
        """Return the command, the other words, and what is in front of them: the first word may name an arm."""
        name, others = split_arm(words)
        if len(others) == len(words):
            return Calibrate, words, "skin calibrate"
        return CalibrateArm[arm_class(name)], others, f"skin calibrate {name}"  # type: ignore[misc]

    @staticmethod
    def of_all() -> Any:
        """Return the command without an arm."""
        return Calibrate

    def run(self) -> int:
        """Calibrate, and show and write the answer."""
        return calibrate_skin(self, mode_of(self))


@dataclass(frozen=True)
class CalibrateArm(Generic[A]):
    """Let an arm make the calibration motion, find the pose of each unit from that, and write the skin file.

    Nothing sees a person meanwhile. The exit code is 1 if a unit was refused or the motion ended early.
    """

    connection: A
    units: UnitOptions = field(default_factory=UnitOptions)
    motion: MotionOptions = field(default_factory=MotionOptions)
    skin: OptionalFile = None
    """Skin file with the units and their assumed links, which are checked; without it, the seven that come with the
    package are heard, and links are identified."""
    out: OptionalFile = None
    """Skin file to write: places and how well they are known. Refused units are as in --skin, or left out."""
    record: OptionalFile = None
    """Recording to write; by default a new one beside the skin file."""
    json: JsonFile = None
    replace: bool = False
    """Overwrite existing files."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    yes: bool = False
    """Do not ask before the arm moves."""

    def run(self) -> int:
        """Move the arm, calibrate, and show and write the answer."""
        from pretouch.cli.calibrate.live import calibrate_live
        from pretouch.cli.calibrate.outputs import outputs_of

        if not self.out:
            raise CalibrationError("--out is missing: name the skin file to write.")
        if not (self.units.keys or self.connection.brings_units):
            raise HardwareError("The arm brings no sensor units: give the file of their keys with --keys.")
        self.units.check()
        with outputs_of(self) as outputs:
            return calibrate_live(self, self.out, outputs)


Mode = Literal["recording", "plan"]
_OPTIONS: dict[Mode, set[str]] = {
    "recording": {"recording", "joints", "topic", "skin", "out", "json", "replace", "arm"},
    "plan": {"plan", "replace", "arm", "duration", "variant", "reach", "speed", "clearance", "floor"},
}


def mode_of(command: Calibrate) -> Mode:
    """Return the way to calibrate; a CalibrationError where options say none, two, or do not go together."""
    given = {name for name, value, default in _leaves(command) if value != default}
    modes = [mode for mode in _OPTIONS if mode in given]
    if not modes:
        raise CalibrationError(
            "The source of the calibration is missing: give --recording FILE or --plan FILE, or name an arm, as in"
            " `pretouch skin calibrate simulated`."
        )
    if len(modes) > 1:
        raise CalibrationError(f"{' and '.join(map(_flag, modes))} are given: choose one of them.")
    odd = sorted(given - _OPTIONS[modes[0]])
    if odd:
        raise CalibrationError(
            f"{', '.join(map(_flag, odd))} {'does' if len(odd) == 1 else 'do'} not go with {_flag(modes[0])}:"
            f" leave {'it' if len(odd) == 1 else 'them'} out."
        )
    return modes[0]


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


def calibrate_skin(command: Calibrate, mode: Mode) -> int:
    """Calibrate; return 1 if a unit was refused or the motion was not finished, or else 0."""
    from pretouch.cli.calibrate.outputs import outputs_of
    from pretouch.cli.calibrate.recording import Sources, calibrate_recording
    from pretouch.robot.description import robot_named
    from pretouch.robot.model import RobotModel

    if command.plan:
        from pretouch.cli.calibrate.motion import write_motion

        write_motion(command, command.plan)
        return 0
    with outputs_of(command) as outputs:
        recorded = command.recorded
        sources = Sources(recorded.recording or Path(), recorded.joints, recorded.topic, command.skin)
        return calibrate_recording(RobotModel(robot_named(command.arm)), sources, outputs)
