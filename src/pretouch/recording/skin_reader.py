"""A recording of sensor units, opened: what each unit measured, as arrays."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.cycles import TOPICS
from pretouch.recording.mcap_file import Contents, chunks, open_mcap, read_messages
from pretouch.recording.packing import unpacked
from pretouch.recording.reader import is_ours
from pretouch.recording.ros import IMU, JOINT_STATE, UNIT_SAMPLE, decoded, packed_data
from pretouch.recording.skin_recording import KeptSample
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
    samples: list[KeptSample]
    """Its datagrams, in the order in which they came."""


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
    samples: dict[str, list[KeptSample]] = {}
    imus, joints = ImuRows(), JointRows(place)
    for kind, data in _messages(place, contents):
        if kind == UNIT_SAMPLE:
            sample = unpacked(KeptSample, packed_data(data, kind))
            samples.setdefault(sample.unit, []).append(sample)
        elif kind == IMU:
            imus.add(decoded(kind, data))
        else:
            joints.add_message(decoded(kind, data))
    if not samples:
        raise RecordingError(
            f"{place} holds no samples of sensor units: give a recording made by `pretouch skin monitor --record`."
        )
    imu = imus.traces()
    units = {unit: UnitTrace(_ranges(rows), imu.get(unit, imu_trace([])), rows) for unit, rows in samples.items()}
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


def _ranges(samples: list[KeptSample]) -> RangeTrace:
    fresh = [s for s in samples if s.sample["flags"] & _RANGE_NEW]

    def column(name: str) -> FloatArray:
        return np.array([s.sample[name] for s in fresh], dtype=np.float64)

    return RangeTrace(
        stamp=np.array([s.stamp for s in fresh], dtype=np.float64),
        bound=np.array([s.bound for s in fresh], dtype=np.float64),
        arrival=np.array([s.arrival for s in fresh], dtype=np.float64),
        distance=column("range_mm") / 1000,
        status=column("range_status").astype(np.int64),
        sigma=column("range_sigma") / 4000,
    )


class ImuRows:
    """Gathers Imu messages by unit."""

    def __init__(self) -> None:
        self._rows: dict[str, list[tuple[float, ...]]] = {}

    def add(self, message: Any) -> None:
        """Take in a message."""
        at, w, a = message.header.stamp, message.angular_velocity, message.linear_acceleration
        row = at.sec + at.nanosec / 1e9, w.x, w.y, w.z, a.x, a.y, a.z
        self._rows.setdefault(message.header.frame_id, []).append(row)

    def traces(self) -> dict[str, ImuTrace]:
        """Return what each unit measured, by its name, in the order of time."""
        return {unit: imu_trace(rows) for unit, rows in self._rows.items()}


def imu_trace(rows: list[tuple[float, ...]]) -> ImuTrace:
    """Return rows of time [s], angular velocity [rad/s] and acceleration [m/s^2] by time."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return ImuTrace(table[:, 0], table[:, 4:], table[:, 1:4])


class JointRows:
    """Gathers the joint positions of one arm."""

    def __init__(self, place: Path, names: Sequence[str] = ()) -> None:
        """Begin with the joints' names if they are known; the first message tells them otherwise."""
        self._place, self.names = place, tuple(names)
        self._stamp: list[float] = []
        self._q: list[FloatArray] = []

    def add_message(self, message: Any) -> None:
        """Take in a JointState; one of other joints than before is a RecordingError."""
        names = tuple(message.name)
        self.names = self.names or names
        if names != self.names:
            raise RecordingError(
                f"{self._place} has states of the joints {', '.join(names)} and of {', '.join(self.names)}: record one"
                " arm per file."
            )
        at = message.header.stamp
        self.add(at.sec + at.nanosec / 1e9, message.position)

    def add(self, stamp: float, q: FloatArray) -> None:
        """Take in positions (n,) [rad] at an instant [s]; those that are not one number for each joint are left out."""
        if np.isfinite(stamp) and q.shape == (len(self.names),) and np.isfinite(q).all():
            self._stamp.append(stamp)
            self._q.append(q)

    def trace(self) -> JointTrace | None:
        """Return the positions by time, the later ones of two at one instant; None without any."""
        if not self._stamp:
            return None
        stamp = np.array(self._stamp)
        order = np.argsort(stamp, kind="stable")
        order = order[np.append(np.diff(stamp[order]) > 0, True)]
        return JointTrace(stamp[order], np.stack(self._q)[order])
