"""The message types of a recording: our own, from the files in `msg/`, and the standard ones of ROS 2."""

from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from itertools import chain
from typing import Any

import pretouch
from pretouch.errors import RecordingError
from pretouch.recording.cdr import Codec, DecodeError, Field, parsed

FORMAT = 1
"""Version of our messages: a change that older programs cannot read raises it."""

LIBRARY = f"pretouch {pretouch.__version__}"
"""What a file says it was written by."""

PACKAGE = "pretouch_msgs"
OWN = (
    "RobotState", "RangeReadings", "Inputs", "Obstacles", "Thresholds", "Contact", "QpSolution", "Touched", "Step",
    "Run", "State", "Truth", "UnitSample", "Touch", "SeenPoints",
    "Payload", "Desired", "MovingFixtures",
)  # fmt: skip
"""Our types; each has a file in `msg/`."""
_ON_TOPICS = ("Run", "Inputs", "Step", "State", "Truth", "Touch", "SeenPoints", "Payload", "Desired")
TOPICS = {f"/pretouch/{name.lower()}": f"{PACKAGE}/msg/{name}" for name in _ON_TOPICS}
TOPICS["/pretouch/moving"] = f"{PACKAGE}/msg/MovingFixtures"
"""Type of the messages on each of our topics."""

_SECTION = f"{'=' * 80}\nMSG: "
"""Stands before the name of each further type in a definition (encoding `ros2msg`)."""


@cache
def own_definition(name: str) -> str:
    """Return the text of one of our message files, comments and all."""
    return (files("pretouch.recording") / "msg" / f"{name}.msg").read_text(encoding="utf-8")


@cache
def _standard() -> dict[str, str]:
    """Return the definitions of the types of ROS 2 Jazzy that are used, by name; since Iron, Range has a variance."""
    sections = own_definition("standard").split(_SECTION)[1:]
    return {name.replace("/", "/msg/"): text for name, _, text in (section.partition("\n") for section in sections)}


def _text(kind: str) -> str:
    """Return the definition of one type alone."""
    package, _, name = kind.split("/")
    return own_definition(name) if package == PACKAGE else _standard()[kind]


@cache
def fields_of(kind: str) -> tuple[Field, ...]:
    """Return the fields of a type."""
    return parsed(_text(kind), kind.partition("/")[0])


_CODEC = Codec(fields_of)


def definition(kind: str) -> str:
    """Return the full definition of a type as MCAP embeds it (encoding `ros2msg`): its own, and that of its parts."""
    parts = (f"{_SECTION}{part.replace('/msg/', '/')}\n{_text(part)}" for part in _CODEC.parts(kind))
    return "".join([_text(kind), *parts])


def make(kind: str, *values: Any) -> Any:
    """Make a message of a type from its fields, in order."""
    return _CODEC.type(kind)(*values)


def encoded(kind: str, message: Any, **given: Any) -> bytes:
    """Return a message as CDR: whatever has its fields as attributes, some of them `given` in place of its own."""
    return _CODEC.encoded(kind, message, **given)


def decoded(kind: str, data: bytes) -> Any:
    """Return the message that CDR bytes hold; its arrays are aligned and writable.

    Raises RecordingError for bytes that hold none.
    """
    try:
        return _CODEC.decoded(kind, data)
    except DecodeError as error:
        raise RecordingError(f"A message of the type {kind} in the recording cannot be read: {error}") from error


def prepare(*kinds: Iterable[str]) -> None:
    """Make ready to encode types: at the first message, that would keep a control loop waiting."""
    for kind in chain(*kinds):
        _CODEC.prepare(kind)
