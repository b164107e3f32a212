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

from pretouch.recording.disk import Disk, Item
from pretouch.recording.messages import PACKAGE, encoded, fields_of, make, prepare
from pretouch.recording.standard import IMU, JOINT_STATE, RANGE, header, imu_items, nanoseconds, range_item, topic_name
from pretouch.recording.traces import check_joints, joint_items
from pretouch.types import FloatArray

UNIT_SAMPLE = f"{PACKAGE}/msg/UnitSample"
"""Type of the messages that hold a datagram as it came."""
READ_WITH = "read it with pretouch.recording.skin_reader.read_skin, or open it in Foxglove"
"""What can be done with such a recording, as the end of a sentence."""
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_STATUS, _KEY_VALUE = "diagnostic_msgs/msg/DiagnosticStatus", "diagnostic_msgs/msg/KeyValue"
_OURS = 5
"""Fields of a `UnitSample` that are the receiver's; the unit's follow, and its IMU data is the last."""


class Arrived(Protocol):
    """A datagram as it came: `UnitSample.msg` says what these are."""

    arrival: float
    stamp: float
    offset: float
    bound: float
    sample: Any
    """All of its own fields by their names there, from `unit` on."""


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
        prepare((UNIT_SAMPLE, RANGE, IMU, JOINT_STATE, DIAGNOSTICS))
        self._fields = [field.name for field in fields_of(UNIT_SAMPLE)[_OURS:-1]]
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
            self._disk.put(partial(self._sample_items, unit, self._time, heard, new))

    def imu(self, unit: str, stamp: FloatArray, acceleration: FloatArray, angular_velocity: FloatArray) -> None:
        """Keep what a unit's IMU measured at instants (M,) [s]: (M, 3) [m/s^2], (M, 3) [rad/s], sensor frame."""
        if not self._sentence and not self.trouble:
            self._disk.put(partial(imu_items, unit, self._time, stamp, acceleration, angular_velocity))

    def joints(self, stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]) -> None:
        """Keep where an arm's n joints were at instants (M,) [s], on the clock of the samples' arrivals.

        Positions q (M, n) [rad], velocities qd (M, n) [rad/s] if they are known, by the joints' names. Nobody may
        change these arrays from here on. RecordingError for other shapes.
        """
        check_joints(stamp, q, qd, names)
        if not self._sentence and not self.trouble:
            self._disk.put(partial(joint_items, self._time, stamp, q, qd, names))

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

    def _sample_items(self, unit: str, time: int, heard: Arrived, new: bool) -> Iterator[Item]:
        sample = heard.sample
        ours = unit, heard.arrival, heard.stamp, heard.offset, heard.bound
        given = (getattr(sample, name) for name in self._fields)
        message = make(
            UNIT_SAMPLE, *ours, *given, np.frombuffer(sample.imu + sample.touch + sample.zones, dtype=np.uint8)
        )
        name = f"/skin/{topic_name(unit)}/sample"
        yield Item(name, UNIT_SAMPLE, sample.sequence, time, encoded(UNIT_SAMPLE, message))
        if new and heard.stamp == heard.stamp:
            distance = sample.range_mm / 1000
            yield range_item(unit, sample.sequence, time, heard.stamp, distance, sample.range_status)

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


def _health_items(time: int, rows: Sequence[Diagnosis]) -> Iterator[Item]:
    statuses = [
        make(
            _STATUS, int(row.level), row.unit, row.message, row.unit,
            [make(_KEY_VALUE, key, value) for key, value in row.values.items()],
        )
        for row in rows
    ]  # fmt: skip
    message = make(DIAGNOSTICS, header(time, ""), statuses)
    yield Item("/diagnostics", DIAGNOSTICS, 0, time, encoded(DIAGNOSTICS, message))
