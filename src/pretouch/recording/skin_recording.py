"""What sensor units sent, recorded without a controller: one MCAP file for the usual viewers and for calibration."""

import atexit
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.disk import Disk, Item
from pretouch.recording.packing import packed
from pretouch.recording.ros import DIAGNOSTICS, IMU, JOINT_STATE, RANGE, messages, packed_message
from pretouch.recording.ros import UNIT_SAMPLE as UNIT_SAMPLE
from pretouch.recording.viewer_topics import header, imu_items, nanoseconds, range_item, topic_name
from pretouch.types import FloatArray
from pretouch.values import value

READ_WITH = "read it with pretouch.recording.skin_reader.read_skin, or open it in Foxglove"
"""What can be done with such a recording, as the end of a sentence."""


class Arrived(Protocol):
    """A datagram as it came: `KeptSample` says what these are."""

    arrival: float
    stamp: float
    offset: float
    bound: float
    sample: Any


@value
class KeptSample:
    """One datagram of a unit, as it came, and when. Times in seconds of the receiver's clock."""

    unit: str
    """The unit's name."""
    arrival: float
    """When the datagram came [s]."""
    stamp: float
    """Earliest instant its range can have been measured [s]; NaN if not known."""
    offset: float
    """The receiver's time minus the unit's [s]; NaN while that is not known."""
    bound: float
    """Most the true offset differs from it [s]."""
    sample: Mapping[str, Any]
    """All fields of the datagram by their names in `pretouch.units.wire.Sample`, integers and bytes as sent."""


class Level(IntEnum):
    """How well a unit is, as diagnostic_msgs/DiagnosticStatus has it."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Diagnosis:
    """How one unit is."""

    unit: str
    level: Level
    message: str
    values: Mapping[str, str]
    """Numbers by name, as text."""


class SkinRecording:
    """An MCAP file that datagrams of sensor units are written to as they come; a context manager.

    A thread writes about twice a second; a killed process loses what was not written by then. A file that is there
    already is never written over: RecordingError.
    """

    def __init__(self, place: Path) -> None:
        self.place = Path(place)
        self.samples = 0
        """Datagrams that were kept."""
        self._time = 0
        messages().prepare(UNIT_SAMPLE, RANGE, IMU, JOINT_STATE, DIAGNOSTICS)
        self._sentence = ""
        self._disk = Disk(self.place)
        atexit.register(self.close)

    @property
    def trouble(self) -> str:
        """'' or, once nothing more can be written, a sentence that says why and what the file holds."""
        return self._disk.trouble

    def sample(self, unit: str, heard: Arrived, new: bool) -> None:
        """Keep one datagram of a unit, which nobody may change from here on.

        `new` says whether its range is a measurement that no datagram before had.
        """
        if self._take(heard.arrival):
            self.samples += 1
            self._disk.put(partial(_sample_items, unit, self._time, heard, new))

    def imu(self, unit: str, stamp: FloatArray, acceleration: FloatArray, angular_velocity: FloatArray) -> None:
        """Keep what a unit's IMU measured at instants (M,) [s]: (M, 3) [m/s^2], (M, 3) [rad/s], sensor frame."""
        if not self._sentence and not self.trouble:
            self._disk.put(partial(imu_items, unit, self._time, stamp, acceleration, angular_velocity))

    def joints(self, stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]) -> None:
        """Keep where an arm's n joints were at instants (M,) [s], on the clock of the samples' arrivals.

        Positions q (M, n) [rad], velocities qd (M, n) [rad/s] if they are known, by the joints' names. Nobody may
        change these arrays from here on. RecordingError for other shapes.
        """
        shape = len(stamp), len(names)
        for what, rows in (("positions", q), ("velocities", q if qd is None else qd)):
            if rows.shape != shape:
                raise RecordingError(
                    f"The joint {what} have the shape {rows.shape}: give {shape}, a row for each instant and a column"
                    " for each joint's name."
                )
        if not self._sentence and not self.trouble:
            self._disk.put(partial(_joint_items, self._time, stamp, q, qd, names))

    def health(self, stamp: float, rows: Sequence[Diagnosis]) -> None:
        """Keep how the units are at an instant [s]."""
        if self._take(stamp):
            self._disk.put(partial(_health_items, self._time, rows))

    def _take(self, stamp: float) -> bool:
        """Go on to an instant, unless nothing more is written."""
        if self._sentence or self.trouble:
            return False
        self._time = nanoseconds(stamp, self._time)
        return True

    def close(self) -> str:
        """End the file, and say what it holds; a second time says the same again."""
        if not self._sentence:
            self._disk.close()
            size = self._disk.size() / 1e6
            self._sentence = self.trouble or f"{self.place} holds {self.samples} samples, in {size:.1f} MB."
            atexit.unregister(self.close)
        return self._sentence

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _sample_items(unit: str, time: int, heard: Arrived, new: bool) -> Iterator[Item]:
    sample = heard.sample
    data = packed(KeptSample(unit, heard.arrival, heard.stamp, heard.offset, heard.bound, sample))
    message = packed_message(sample.sequence, data, UNIT_SAMPLE)
    yield Item(f"/skin/{topic_name(unit)}/sample", UNIT_SAMPLE, sample.sequence, time, message)
    if new and heard.stamp == heard.stamp:
        distance = sample.range_mm / 1000
        yield range_item(unit, sample.sequence, time, heard.stamp, distance, sample.range_status)


def _joint_items(
    instead: int, stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]
) -> Iterator[Item]:
    """Yield states of joints at instants (M,) [s]: (M, n) [rad], [rad/s]; what is no time stands at `instead` [ns]."""
    nothing, texts = np.zeros(0), list(names)
    for i, t in enumerate(stamp.tolist()):
        time = nanoseconds(t, instead)
        velocity = nothing if qd is None else np.array(qd[i], dtype=np.float64)
        row = np.array(q[i], dtype=np.float64)
        state = messages().make(JOINT_STATE, header(time, ""), texts, row, velocity, nothing)
        yield Item("/joint_states", JOINT_STATE, 0, time, messages().encoded(JOINT_STATE, state))


def _health_items(time: int, rows: Sequence[Diagnosis]) -> Iterator[Item]:
    make = messages().make
    statuses = [
        make(
            "diagnostic_msgs/msg/DiagnosticStatus", int(row.level), row.unit, row.message, row.unit,
            [make("diagnostic_msgs/msg/KeyValue", key, value) for key, value in row.values.items()],
        )
        for row in rows
    ]  # fmt: skip
    message = make(DIAGNOSTICS, header(time, ""), statuses)
    yield Item("/diagnostics", DIAGNOSTICS, 0, time, messages().encoded(DIAGNOSTICS, message))
