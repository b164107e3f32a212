"""A recording, opened: each of its control steps, and the controllers that made them."""

import struct
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pretouch.controller import ControllerState
from pretouch.errors import RecordingError
from pretouch.recording.codec import (
    decode_desired,
    decode_inputs,
    decode_moving,
    decode_payload,
    decode_points,
    decode_step,
    decode_touch,
    decode_truth,
)
from pretouch.recording.container import Contents, begins_as_mcap, messages_of
from pretouch.recording.messages import LIBRARY, TOPICS, definition
from pretouch.recording.setting import Run, Tangents, decode_run
from pretouch.recording.skin_recording import READ_WITH, UNIT_SAMPLE
from pretouch.recording.state_codec import decode_state
from pretouch.recording.truth import Truth
from pretouch.types import ControlStep, FloatArray, Inputs, RobotState
from pretouch.values import value

__all__ = ["Kept", "Recorded", "Run", "open_recording"]

_NUMBER = struct.Struct("<Q")
"""Number of the step, first in each of our messages, behind the encapsulation header."""
_STAMP = struct.Struct("<d")
_HEAD = 4


@value
class Kept:
    """One control step of a recording."""

    run: int
    """Which of the runs made it."""
    inputs: Inputs | None
    """None if they could not be put into a message."""
    step: ControlStep
    truth: Truth | None
    """None if there was no simulation."""
    snapshot: ControllerState | None
    """The state the step began with, at some steps."""
    anew: bool = False
    """Whether that state does not follow from the step before."""


MISSING_INPUTS = "they are missing"

Raw = dict[str, dict[int, bytes]]
"""Messages of each of our topics, by the number of the step."""


class Recorded:
    """A recording: a sequence of control steps, each decoded when it is asked for."""

    def __init__(self, place: Path, raw: Raw, said: str) -> None:
        self.place = place
        self.said = said
        """What is missing, as a sentence, or ''."""
        self.complete = not said
        self._raw = raw
        self._numbers = sorted(raw["/pretouch/step"])
        runs = [raw["/pretouch/run"][n] for n in sorted(raw["/pretouch/run"])]
        self.runs: tuple[Run, ...] = tuple(decode_run(data, self._tangents) for data in runs)
        """The controllers that made steps, in order."""
        self._begins = [run.sequence for run in self.runs]

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, i: int) -> Kept:
        number = self._numbers[i]
        raw = self._raw
        truth = raw["/pretouch/truth"].get(number)
        state = raw["/pretouch/state"].get(number)
        anew, snapshot = (False, None) if state is None else decode_state(state)
        run, step = max(0, bisect_right(self._begins, number) - 1), decode_step(raw["/pretouch/step"][number])[1]
        if not _fits(step, *self.runs[run].sizes):
            raise RecordingError(
                f"Step {number} of {self.place} is not of the arm and skin that the recording says made it: use one"
                " that is whole."
            )
        return Kept(
            run=run,
            inputs=self._inputs(number),
            step=step,
            truth=None if truth is None else decode_truth(truth)[1],
            snapshot=snapshot,
            anew=anew,
        )

    def _inputs(self, number: int) -> Inputs | None:
        """Return all that a step was given; None where a part of it is missing."""
        raw = self._raw
        data, touch = (raw[f"/pretouch/{part}"].get(number) for part in ("inputs", "touch"))
        inputs = None if data is None else decode_inputs(data)[1]
        if inputs is not None and touch is not None:
            inputs = replace(inputs, touch=decode_touch(touch))
        payload = raw["/pretouch/payload"].get(number)
        if inputs is not None and payload is not None:
            inputs = replace(inputs, payload=decode_payload(payload))
        moving = raw["/pretouch/moving"].get(number)
        if inputs is not None and moving is not None:
            inputs = replace(inputs, moving=decode_moving(moving))
        desired = raw["/pretouch/desired"].get(number)
        if inputs is not None and desired is not None:
            inputs = replace(inputs, desired=decode_desired(desired))
        return self._with_points(number, inputs)

    def _with_points(self, number: int, inputs: Inputs | None) -> Inputs | None:
        """Return inputs with the points of outside sources, if there were any; None where these are missing."""
        raw = self._raw["/pretouch/seenpoints"]
        if inputs is None or number not in raw:
            return inputs
        same_as, points = decode_points(raw[number])
        if same_as != number:
            if same_as not in raw:
                return None
            points = decode_points(raw[same_as])[1]
        return replace(inputs, points=points)

    def __iter__(self) -> Iterator[Kept]:
        return (self[i] for i in range(len(self)))

    def robot_states(self) -> Iterator[RobotState]:
        """Yield the robot's state of each step whose inputs were kept."""
        for number in self._numbers:
            data = self._raw["/pretouch/inputs"].get(number)
            inputs = None if data is None else decode_inputs(data)[1]
            if inputs is not None:
                yield inputs.robot

    def number(self, i: int) -> int:
        """Return the number a step had when it was recorded: where some are missing it is not `i`."""
        return self._numbers[i]

    def unreadable(self, i: int) -> str:
        """Say what is known of inputs that could not be kept, or ''."""
        inputs = self._raw["/pretouch/inputs"].get(self._numbers[i])
        return MISSING_INPUTS if inputs is None else decode_inputs(inputs)[2]

    def step_data(self, i: int) -> bytes:
        """Return a step as it was written."""
        return self._raw["/pretouch/step"][self._numbers[i]]

    def tangent(self, i: int) -> FloatArray | None:
        """Return the path's tangent (3,) at a step, where it was kept with it."""
        tangent = decode_step(self.step_data(i))[2]
        return tangent if len(tangent) else None

    def stamps(self) -> FloatArray:
        """Stamps (S,) of the steps [s]."""
        steps = self._raw["/pretouch/step"]
        return np.array([_STAMP.unpack_from(steps[n], _HEAD + _NUMBER.size)[0] for n in self._numbers])

    def _tangents(self, number: int) -> Tangents:
        """Find where the path led in the steps of the run that begins with a number."""
        later = [begin for begin in self._begins if begin > number]
        found: Tangents = {}
        for n in self._numbers:
            if number <= n and (not later or n < later[0]):
                _, step, tangent = decode_step(self._raw["/pretouch/step"][n])
                if len(tangent):
                    found[step.path_phase] = step.path_position, tangent
        return found


def _fits(step: ControlStep, joints: int, units: int) -> bool:
    """Whether the arrays of a step are as long as those of an arm with so many joints and units."""
    near, touched = step.obstacles, step.touched
    of_joints = (step.q, step.q_commanded, step.command, step.residual, step.qp.qd)
    of_obstacles = (near.point, near.ee_distance, near.body_point, near.link, near.direction, near.body_distance)
    of_touches = (touched.point, touched.force, touched.sigma, touched.probability)
    return (
        all(len(array) == joints for array in of_joints)
        and len(step.range_distance) == units
        and all(len(array) == len(near.unit) for array in (*of_obstacles, near.closing_speed))
        and all(len(array) == len(touched.link) for array in of_touches)
        and len(step.restricted) == len(step.approach_limit)
    )


def open_recording(place: Path) -> Recorded:
    """Open a recording, finished or cut off.

    RecordingError for a file that is missing, is not an MCAP file, is another program's (`pretouch detect` reads those)
    or is of a later version.
    """
    place = Path(place)
    contents, raw = Contents(), {topic: dict[int, bytes]() for topic in TOPICS}
    if place.exists() and not (place.is_file() or place.is_dir()):  # as a pipe or a device, which may have no end
        raise RecordingError(f"{place} is no file: give a recording that is one.")
    try:
        with place.open("rb") as file:
            if not begins_as_mcap(file):
                raise RecordingError(_no_mcap(place))
            for topic, _, _, data in messages_of(file, contents, lambda topic, kind: TOPICS.get(topic) == kind):
                if len(data) >= _HEAD + _NUMBER.size + _STAMP.size:
                    raw[topic].setdefault(_NUMBER.unpack_from(data, _HEAD)[0], data)
    except OSError as error:
        reason = "it does not exist" if isinstance(error, FileNotFoundError) else error.strerror
        raise RecordingError(f"The recording {place} cannot be read: {reason}.") from error
    _check(place, contents, raw)
    return Recorded(place, raw, _missing(place, contents))


def _check(place: Path, contents: Contents, raw: Raw) -> None:
    """Refuse a file without a step of ours, or with messages that are not these."""
    for topic, number, _ in contents.channels.values():
        kind, schema = contents.schemas.get(number, ("", b""))
        if TOPICS.get(topic) == kind and not is_ours(schema, kind):
            raise RecordingError(
                f"{place} was recorded by another version of pretouch, with different messages on {topic}: open it with"
                " that version."
            )
    if raw["/pretouch/step"] and raw["/pretouch/run"]:
        return
    if any(contents.of(channel)[1] == UNIT_SAMPLE for channel in contents.channels):
        raise RecordingError(f"{place} holds samples of sensor units, but no control step: {READ_WITH}.")
    if contents.library.startswith(LIBRARY.split()[0]) or any(t in TOPICS for t, _, _ in contents.channels.values()):
        raise RecordingError(f"{place} holds no control step, because the run ended before the first was written.")
    raise RecordingError(
        f"{place} is not a recording of pretouch: for one of another program use `pretouch detect {place}`."
    )


def is_ours(schema: bytes, kind: str) -> bool:
    """Whether a schema record ends with the definition of a type of ours, comments apart."""
    ours, at = definition(kind), len(schema)
    text = schema[max(0, at - 4 * len(ours)) :].decode(errors="replace")
    return _bare(text).endswith(_bare(ours))


def _bare(text: str) -> str:
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    return "\n".join(" ".join(words) for words in lines if words)


def _no_mcap(place: Path) -> str:
    if place.stat().st_size == 0:
        return f"{place} is empty, because the run ended before anything was written."
    return f"{place} is not an MCAP file: for a recording of another program use `pretouch detect {place}`."


def _missing(place: Path, contents: Contents) -> str:
    """Say what is missing of a file, or ''."""
    said = []
    if contents.damaged:
        said.append(f"{contents.damaged} damaged part{'s' if contents.damaged > 1 else ''} left out")
    if not contents.complete:
        said.append("the end is missing, as after a run that was killed")
    if not said:
        return ""
    return f"{place}: {' and '.join(said)}; every whole part of it is read."
