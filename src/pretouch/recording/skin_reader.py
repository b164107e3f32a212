"""A recording of sensor units, opened: what each unit measured, as arrays."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.mcap_file import Contents, chunks, open_mcap, read_messages
from pretouch.recording.messages import TOPICS, decoded
from pretouch.recording.reader import is_ours
from pretouch.recording.skin_recording import UNIT_SAMPLE
from pretouch.recording.standard import IMU, JOINT_STATE
from pretouch.recording.traces import ImuRows, JointRows, no_imu
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_READ = (UNIT_SAMPLE, IMU, JOINT_STATE)
_RANGE_NEW = 1
"""Flag of a sample with a range that no sample before had (docs/reference/wire.md)."""


@value
class RangeTrace:
    """Readings of one unit, in the order in which they came. R of them."""

    stamp: FloatArray
    """(R,) earliest instant of the measurement [s], NaN while the unit's clock was not known."""
    bound: FloatArray
    """(R,) most the unit's clock can have been off by [s]."""
    arrival: FloatArray
    """(R,) when the datagram came [s]."""
    distance: FloatArray
    """(R,) [m]."""
    status: IntArray
    """(R,) `RangeStatus` codes."""
    sigma: FloatArray
    """(R,) standard deviation by the sensor's own estimate [m]."""


@dataclass(frozen=True, eq=False)
class UnitTrace:
    """All that one unit measured."""

    range: RangeTrace
    imu: ImuTrace
    samples: list[Any]
    """Its datagrams, field by field as in `UnitSample.msg`."""


@dataclass(frozen=True, eq=False)
class SkinTrace:
    """A recording of sensor units."""

    units: dict[str, UnitTrace]
    """By name, in the order in which they were first heard."""
    joints: JointTrace | None
    """Where the arm's joints were, if that was recorded."""
    joint_names: tuple[str, ...]
    """Names of these joints, in the order of the columns."""
    complete: bool
    """Whether the recording was ended in order."""

    @property
    def samples(self) -> int:
        """Number of datagrams."""
        return sum(len(unit.samples) for unit in self.units.values())

    @property
    def duration(self) -> float:
        """Time from the first datagram to the last [s]."""
        first = min(unit.samples[0].arrival for unit in self.units.values())
        return float(max(unit.samples[-1].arrival for unit in self.units.values()) - first)


def read_skin(place: Path) -> SkinTrace:
    """Read what `SkinRecording` wrote, finished or cut off. RecordingError for a file that holds nothing of it."""
    place = Path(place)
    contents = Contents()
    samples: dict[str, list[Any]] = {}
    imus, joints = ImuRows(), JointRows(place)
    for kind, data in _messages(place, contents):
        if kind == UNIT_SAMPLE:
            sample = decoded(kind, data)
            samples.setdefault(sample.id, []).append(sample)
        elif kind == IMU:
            imus.add(data)
        else:
            joints.add_message(decoded(kind, data))
    if not samples:
        raise RecordingError(
            f"{place} holds no samples of sensor units: give a recording made by `pretouch skin monitor --record`."
        )
    imu = imus.traces()
    units = {unit: UnitTrace(_ranges(rows), imu.get(unit, no_imu()), rows) for unit, rows in samples.items()}
    return SkinTrace(units, joints.trace(), joints.names, contents.complete)


def holds_units(place: Path) -> bool:
    """Whether a file is a recording of sensor units: what its first chunks hold tells."""
    contents = Contents()
    with suppress(OSError), Path(place).open("rb") as file:  # whoever opens it next says what is wrong
        for _, messages in chunks(file, contents):
            kinds = {message.kind for message in messages}
            if UNIT_SAMPLE in kinds or not kinds.isdisjoint(TOPICS.values()):
                return UNIT_SAMPLE in kinds
    return False


def _messages(place: Path, contents: Contents) -> Iterator[tuple[str, bytes]]:
    """Yield type and CDR of all messages to read in the whole chunks of a file."""
    with open_mcap(place, "give a recording made by `pretouch skin monitor --record`") as file:
        for message in read_messages(file, contents):
            if message.kind in _READ:
                yield message.kind, message.data
    for channel in contents.channels.values():
        if contents.kind(channel) == UNIT_SAMPLE and not is_ours(contents, channel):
            raise RecordingError(
                f"{place} was recorded by another version of pretouch, with different samples of units: open it with"
                " that version."
            )


def _ranges(samples: list[Any]) -> RangeTrace:
    fresh = [s for s in samples if s.flags & _RANGE_NEW]
    return RangeTrace(
        stamp=np.array([s.stamp for s in fresh], dtype=np.float64),
        bound=np.array([s.bound for s in fresh], dtype=np.float64),
        arrival=np.array([s.arrival for s in fresh], dtype=np.float64),
        distance=np.array([s.range_mm for s in fresh], dtype=np.float64) / 1000,
        status=np.array([s.range_status for s in fresh], dtype=np.int64),
        sigma=np.array([s.range_sigma for s in fresh], dtype=np.float64) / 4000,
    )
