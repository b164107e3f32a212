"""Types of options, groups of options that several commands have, and the word that names an arm."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from pretouch.arms import DEFAULT, ArmOptions
from pretouch.errors import HardwareError
from pretouch.params.pretouch import OFFERED
from pretouch.units import HOST, PORT

A = TypeVar("A", bound=ArmOptions)


Words = tuple[str, ...]
Paths = tuple[Path, ...]
Numbers = tuple[float, ...]
Counts = tuple[int, ...]
_LISTED = {
    str: ("A,B,...", "words"),
    Path: ("A,B,...", "folders"),
    float: ("X,Y,...", "numbers"),
    int: ("N,N,...", "whole numbers"),
}
REGISTRY = tyro.constructors.ConstructorRegistry()
"""How tyro reads tuples of any length: as values between commas. Lists are values that each are a word."""


@REGISTRY.primitive_rule
def _listed(info: tyro.constructors.PrimitiveTypeInfo) -> PrimitiveConstructorSpec[tuple[Any, ...]] | None:
    kind, *rest = get_args(info.type) or (None,)
    if info.type_origin is not tuple or rest != [...] or kind not in _LISTED:
        return None
    metavar, noun = _LISTED[kind]

    def read(words: list[str]) -> tuple[Any, ...]:
        try:
            return tuple(kind(word.strip()) for word in words[0].split(",") if word.strip())
        except ValueError:
            raise ValueError(f"{words[0]!r}: give {noun}, separated by commas") from None

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda value: [",".join(map(str, value))],
    )


@REGISTRY.primitive_rule
def _optional(info: tyro.constructors.PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    kind, *rest = get_args(info.type) or (None,)
    if kind not in (int, float) or rest != [type(None)]:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=kind.__name__.upper(),
        instance_from_str=lambda words: None if words[0] == "None" else kind(words[0]),
        is_instance=lambda value: value is None or isinstance(value, kind),
        str_from_instance=lambda value: [str(value)],
    )


OptionalFile = Annotated[Path | None, tyro.conf.arg(metavar="FILE")]
"""A file, or none."""
JsonFile = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="FILE", help="File for the numbers, or - for standard output: text then goes to standard error."
    ),
]
"""Where a command writes its numbers; see `writing.numbers_to`."""


ProfileText = Annotated[str, tyro.conf.arg(metavar="NAME", help=f"{OFFERED} Or NAME:GROUP.FIELD=VALUE.")]
"""A profile by its name, with changes."""


def split_arm(words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the name of the arm that words begin with, the default one where they name none, and the other words."""
    if words and not words[0].startswith("-"):
        return words[0], words[1:]
    return DEFAULT, words


@dataclass(frozen=True)
class RobotOptions:
    """The arm's model, and what is remembered of it."""

    arm: str = "panda"
    """Model of the arm: panda, fr3, or the folder of an imported arm."""
    gravity: Numbers = ()
    """Direction of gravity in the arm's base frame, of any length: 0,0,1 for an arm that hangs; by default the arm's
    own, for panda and fr3 0,0,-1."""
    confirm_push: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Ask for the guided pushes even if the force sign of this robot is confirmed."""
    learnt: OptionalFile = None
    """File of the arm's free-motion model, loaded at the start and saved at the end; by default one file per robot."""
    no_learnt: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start without a free-motion model, and save none."""


@dataclass(frozen=True)
class UnitOptions:
    """Keys of the sensor units, and the address to receive them at."""

    keys: OptionalFile = None
    """File of the keys of units that are received over the network; without it, the arm's own or simulated ones."""
    units_host: str = HOST
    """Address to receive units at; real ones need 0.0.0.0, which is every address of this machine."""
    units_port: int = PORT
    """UDP port to receive units at."""

    def __post_init__(self) -> None:
        if not self.units_host:
            raise HardwareError("--units-host is empty: give 127.0.0.1, or 0.0.0.0 for every address of this machine.")


@dataclass(frozen=True)
class SkinOptions(UnitOptions):
    """The sensor units."""

    skin: OptionalFile = None
    """Skin file; by default the sixteen units that come with the package, and of profiles such as paper the seven."""
    no_skin: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The arm carries no units. The profile must not need any, such as blind."""


@dataclass(frozen=True)
class ProcessOptions:
    """Files of the run, and how its process runs."""

    record: OptionalFile = None
    """Recording to write."""
    json: JsonFile = None
    holds: str = "runs/holds"
    """Folder for the last seconds before a HOLD that lasts until a person resumes."""
    priority: int | None = None
    """Real-time priority of the control loop, 1 to 99; by default the process keeps its own."""
    cpu: int | None = None
    """Processor to run on; by default the system decides."""
    yes: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not ask before the arm moves."""


@dataclass(frozen=True)
class TaskOptions:
    """Task of the arm."""

    path: Literal["circle", "line", "hold"] = "circle"
    """circle and line: the paper's paths, started at the nearest point. hold: stay in place, and yield when touched."""
    center: Numbers = ()
    """Centre of the circle [m], base frame; by default 0.5,0,0.25, for an imported arm where it reaches."""
    radius: float | None = None
    """Radius of the circle [m]; by default 0.25, for an imported arm scaled by its reach."""
    profile: ProfileText = "pretouch"
    seconds: float = 0.0
    """Duration [s]; 0: until it is stopped."""
    approach: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """First move slowly to the start of the path."""
    floor: float | None = None
    """Height of the floor below the arm, base frame [m]; by default 0, level with its base, and -0.2 in simulation."""
