"""A recording, opened: each of its control steps, and the controllers that made them."""

import struct
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from pretouch.controller import ControllerState
from pretouch.errors import RecordingError
from pretouch.recording.cycles import INPUTS, RUN, STATE, STEP, TOPICS, TRUTH, KeptInputs, KeptState, inputs_of
from pretouch.recording.mcap_file import Contents, Message, chunk_at, chunks, indexed_chunks, message_count, open_mcap
from pretouch.recording.packing import unpacked
from pretouch.recording.ros import LIBRARY, READ_WITH, UNIT_SAMPLE, check_version, packed_data, value_of
from pretouch.recording.run import Run
from pretouch.recording.simulation import Truth
from pretouch.types import ControlStep, FloatArray, Inputs, IntArray
from pretouch.values import value

_NUMBER = struct.Struct("<Q")
"""Number of the step, first in each of our messages, behind the encapsulation header."""
_STAMP = struct.Struct("<d")
_HEAD = 4


@value
class Kept:
    """One control step of a recording."""

    number: int
    """The number it had when it was recorded: where some are missing it is not its place."""
    run: int
    """Index of the run that the step belongs to."""
    inputs: Inputs | None
    """Inputs of the step; None if they could not be recorded."""
    unreadable: str
    """Reason why there are no inputs, or ''."""
    step: ControlStep
    truth: Truth | None
    """True values of a simulation; None without one."""
    snapshot: ControllerState | None
    """The state the step began with, at some steps; `Controller.with_places` tells where fields of its memory lie."""
    anew: bool = False
    """True if that state does not follow from the step before."""


MISSING_INPUTS = "they are missing"

_REMEDY = "for a recording of another program use `pretouch detect`"
_CUT = "the end is missing, as after a run that was killed, or damaged; every whole part before it is read"
_CHUNKS = 4
"""Chunks that are held in memory: half a second and 0.3 MB each."""

Raw = dict[tuple[str, int], bytes]
"""Messages of our topics by topic and number of the step."""


class _Span(NamedTuple):
    """A chunk, and the numbers of the first and the last step of which it holds messages."""

    offset: int
    first: int
    last: int


class Recorded:
    """A recording: a sequence of control steps, each read when it is asked for.

    Where the file has an index, nothing but that is read at first; without one, as after a run that was killed, the
    file is read through once. In memory are the last chunks that were read.
    """

    def __init__(self, place: Path, contents: Contents, spans: list[_Span], numbers: IntArray, runs: Raw) -> None:
        self.place = place
        self.complete = contents.complete
        self.sentence = "" if self.complete else f"{place}: {_CUT}."
        """Sentence on the missing end of the file, or ''."""
        self._contents, self._spans, self._numbers = contents, spans, numbers
        self._firsts, self._lasts = [span.first for span in spans], [span.last for span in spans]
        self._chunk = lru_cache(_CHUNKS)(self._read)
        self.runs = tuple(Run(number, packed_data(runs[RUN, number])) for _, number in sorted(runs))
        """The controllers that made steps, in order."""
        self._begins = [run.sequence for run in self.runs]

    def _read(self, offset: int) -> Raw:
        with self.place.open("rb") as file:
            return _ours(chunk_at(file, offset, self._contents))

    def _get(self, topic: str, number: int) -> bytes | None:
        """Return a message of a step, None where there is none."""
        for i in range(bisect_left(self._lasts, number), bisect_right(self._firsts, number)):
            data = self._chunk(self._spans[i].offset).get((topic, number))
            if data is not None:
                return data
        return None

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, i: int) -> Kept:
        number = int(self._numbers[i])
        truth, state = self._get(TRUTH, number), self._get(STATE, number)
        before = None if state is None else unpacked(KeptState, packed_data(state))
        inputs = self._inputs(number)
        return Kept(
            number=number,
            run=max(0, bisect_right(self._begins, number) - 1),
            inputs=inputs.inputs,
            unreadable=inputs.unreadable,
            step=self.step(i),
            truth=None if truth is None else value_of(Truth, truth),
            snapshot=None if before is None else before.state,
            anew=before is not None and before.anew,
        )

    def _inputs(self, number: int) -> KeptInputs:
        """Return all that a step was given, the points of outside sources with it; None where a part is missing."""
        data = self._get(INPUTS, number)
        packed = KeptInputs(None, -1, MISSING_INPUTS) if data is None else inputs_of(packed_data(data))
        if packed.inputs is None or packed.points_at in (-1, number):
            return packed
        data = self._get(INPUTS, packed.points_at)
        others = None if data is None else inputs_of(packed_data(data)).inputs
        if others is None:
            return KeptInputs(None, -1, MISSING_INPUTS)
        return KeptInputs(replace(packed.inputs, points=others.points))

    def __iter__(self) -> Iterator[Kept]:
        return (self[i] for i in range(len(self)))

    def step(self, i: int) -> ControlStep:
        """Return a step alone."""
        step: ControlStep = value_of(ControlStep, self.step_data(i))
        return step

    def step_data(self, i: int) -> bytes:
        """Return a step as it was written."""
        data = self._get(STEP, int(self._numbers[i]))
        if data is None:
            raise RecordingError(
                f"Step {self._numbers[i]} is missing in {self.place}, whose index lists it: use a copy that is whole."
            )
        return data

    def stamps(self) -> FloatArray:
        """Stamps (S,) of the steps [s]."""
        return np.array([_STAMP.unpack_from(self.step_data(i), _HEAD + _NUMBER.size)[0] for i in range(len(self))])


def open_recording(place: Path) -> Recorded:
    """Open a recording, finished or cut off.

    RecordingError for a file that is missing, is not an MCAP file, is another program's (`pretouch detect` reads those)
    or is of another version.
    """
    place, contents = Path(place), Contents()
    with open_mcap(place, _REMEDY) as file:
        spans, numbers, runs = _by_index(file, contents) or _by_reading(file, contents)
    check_version(place, contents)
    if not (len(numbers) and runs):
        raise RecordingError(_why_none(place, contents))
    return Recorded(place, contents, spans, numbers, runs)


_Parts = tuple[list[_Span], IntArray, Raw]
"""Chunks with messages of ours, the numbers of all steps, and what describes their runs."""


def _by_index(file: BinaryIO, contents: Contents) -> _Parts | None:
    """Use the index at the end of a file of ours: its chunks hold whole cycles, and none is missing."""
    listed = indexed_chunks(file, contents)
    ids = {channel.topic: channel.id for channel in contents.channels.values()}
    if not listed or not _by_us(contents) or not ids.keys() >= {STEP, RUN}:
        return None
    spans: list[_Span] = []
    runs: Raw = {}
    number: int | None = None
    for chunk in listed:
        if number is None or ids[RUN] in chunk.message_index_offsets:
            ours = _ours(chunk_at(file, chunk.chunk_start_offset, contents))
            runs |= {key: data for key, data in ours.items() if key[0] == RUN}
            number = min((n for _, n in ours), default=None) if number is None else number
        count = message_count(file, chunk, ids[STEP])
        if number is not None and count:
            spans.append(_Span(chunk.chunk_start_offset, number, number + count - 1))
            number += count
    return spans, np.arange(spans[0].first, spans[-1].last + 1), runs


def _by_reading(file: BinaryIO, contents: Contents) -> _Parts:
    """Read a file through that has no index, or was written by another tool."""
    spans: list[_Span] = []
    runs: Raw = {}
    steps: set[int] = set()
    file.seek(0)
    for offset, messages in chunks(file, contents):
        ours = _ours(messages)
        runs |= {key: data for key, data in ours.items() if key[0] == RUN}
        steps |= {n for topic, n in ours if topic == STEP}
        if ours:
            numbers = [n for _, n in ours]
            spans.append(_Span(offset, min(numbers), max(numbers)))
    return spans, np.array(sorted(steps), dtype=np.int64), runs


def _ours(messages: list[Message]) -> Raw:
    """Return the messages on our topics, the first of two alike."""
    raw: Raw = {}
    for topic, kind, data, _ in messages:
        if TOPICS.get(topic) == kind and len(data) >= _HEAD + _NUMBER.size:
            raw.setdefault((topic, _NUMBER.unpack_from(data, _HEAD)[0]), data)
    return raw


def _by_us(contents: Contents) -> bool:
    return contents.library.partition(" ")[0] == LIBRARY.partition(" ")[0]


def _why_none(place: Path, contents: Contents) -> str:
    """Say what a file is that has no step of ours."""
    if any(contents.kind(channel) == UNIT_SAMPLE for channel in contents.channels.values()):
        return f"{place} holds samples of sensor units, but no control step: {READ_WITH}."
    if _by_us(contents) or any(channel.topic in TOPICS for channel in contents.channels.values()):
        return f"{place} holds no control step, because the run ended before the first was written."
    return f"{place} is not a recording of pretouch: {_REMEDY}."
