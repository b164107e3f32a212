"""Recordings of sensor units without a controller, written and read: MCAP for the usual viewers and for calibration."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Self

import numpy as np

from pretouch.calibration.stamps import ImuCounters, instants
from pretouch.errors import RecordingError
from pretouch.recording.disk import Disk, Item
from pretouch.recording.mcap_file import Contents, chunks, open_mcap
from pretouch.recording.ros import IMU, JOINT_STATE, RANGE, UNIT_SAMPLE, check_version, decoded, messages
from pretouch.recording.viewer_topics import header, item, nanoseconds, range_item, topic_name
from pretouch.sensing.unit import LARGEST_COUNT, counts_of
from pretouch.traces import ImuTrace
from pretouch.types import FloatArray
from pretouch.units.unit import Received, imu_batch
from pretouch.units.wire import SAMPLE_LEAST, TAG_SIZE, Flag, imu_values, sample_of

_UNKNOWN = np.array([-1.0, *np.zeros(8)])
"""Covariance that says a quantity is not there (sensor_msgs/Imu)."""


class SkinRecording:
    """An MCAP file that datagrams of sensor units are written to as they come; a context manager.

    A thread writes about twice a second; a killed process loses what was not written by then. A file that is there
    already is never written over: RecordingError.
    """

    def __init__(self, place: Path) -> None:
        self.place = Path(place)
        self.samples = 0
        """Datagrams in it."""
        self._time = 0
        messages().prepare(UNIT_SAMPLE, RANGE, IMU, JOINT_STATE)
        self._disk = Disk(self.place)

    @property
    def trouble(self) -> str:
        """'' or, once nothing more can be written, a sentence that says why and what the file holds."""
        return self._disk.trouble

    def add(self, samples: Iterable[Received], ids: Sequence[str]) -> None:
        """Add datagrams of the units of these ids, in their order in the skin. Nobody may change them from here on."""
        for one in samples:
            if not self._disk.over:
                self._time = nanoseconds(one.arrival, self._time)
                self.samples += 1
                self._disk.put(partial(_sample_items, ids[one.unit], self._time, one))

    def joints(self, stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]) -> None:
        """Add where an arm's n joints were at instants (M,) [s], on the clock of the samples' arrivals.

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
        if not self._disk.over:
            self._disk.put(partial(_joint_items, self._time, stamp, q, qd, names))

    def close(self) -> str:
        """End the file, and say what it holds; a second time says the same again."""
        return self._disk.close(f"{self.samples} samples")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _sample_items(unit: str, time: int, received: Received) -> Iterator[Item]:
    """Yield a datagram as it came, and its range and IMU samples, each with a known time, for viewers."""
    sample, topic = received.sample, f"/skin/{topic_name(unit)}"
    times = received.arrival, received.stamp, received.offset, received.bound
    datagram = np.frombuffer(sample.body(), np.uint8)
    yield item(f"{topic}/sample", UNIT_SAMPLE, sample.sequence, time, sample.sequence, unit, *times, datagram)
    if sample.flags & Flag.RANGE_NEW and received.stamp == received.stamp:
        distance = sample.range_mm / 1000
        yield range_item(unit, sample.sequence, time, received.stamp, distance, sample.range_status)
    if (batch := imu_batch(received)) is None:
        return
    turn, nothing = messages().make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0), np.zeros(9)
    for stamp, a, w in zip(batch.stamp.tolist(), batch.acceleration, batch.angular_velocity, strict=True):
        at = nanoseconds(stamp, time)
        vectors = messages().xyz("Vector3", w), nothing, messages().xyz("Vector3", a), nothing
        yield item(f"{topic}/imu", IMU, 0, at, header(at, unit), turn, _UNKNOWN, *vectors)


def _joint_items(
    instead: int, stamp: FloatArray, q: FloatArray, qd: FloatArray | None, names: Sequence[str]
) -> Iterator[Item]:
    """Yield states of joints at instants (M,) [s]: (M, n) [rad], [rad/s]; what is no time stands at `instead` [ns]."""
    nothing, texts = np.zeros(0), list(names)
    for i, t in enumerate(stamp.tolist()):
        time = nanoseconds(t, instead)
        velocity = nothing if qd is None else np.array(qd[i], dtype=np.float64)
        row = np.array(q[i], dtype=np.float64)
        yield item("/joint_states", JOINT_STATE, 0, time, header(time, ""), texts, row, velocity, nothing)


@dataclass(frozen=True, eq=False)
class UnitTrace:
    """Measurements of one unit."""

    samples: list[Received]
    """Its datagrams, in the order in which they came; `unit` is the index of the unit in the recording."""
    imu: ImuTrace
    """Samples in the order of the datagrams; unknown stamps are NaN, see `calibration.stamps.instants`."""
    acceleration_max: float
    """Largest that the accelerometer could tell [m/s^2]; inf without a sample."""
    angular_velocity_max: float
    """Largest that the gyroscope could tell [rad/s]; inf without a sample."""


@dataclass(frozen=True, eq=False)
class SkinTrace:
    """A recording of sensor units. All times are of one clock, but for the units' unknown delays."""

    units: dict[str, UnitTrace]
    """Units by name, in the order of their first datagrams."""
    complete: bool
    """True if the recording was ended in order."""


def read_skin(place: Path) -> SkinTrace:
    """Read a file of `SkinRecording`, complete or cut off. RecordingError for any other file."""
    place, contents, way_out = Path(place), Contents(), "give a recording made by `pretouch skin monitor --record`"
    samples: dict[str, list[Received]] = {}
    with open_mcap(place, way_out) as file:
        for message in chain.from_iterable(messages for _, messages in chunks(file, contents)):
            if message.kind == UNIT_SAMPLE:
                if not samples:
                    check_version(place, contents)
                datagram = decoded(UNIT_SAMPLE, message.data)
                samples.setdefault(datagram.unit, []).append(_received(place, datagram, list(samples)))
    if not samples:
        raise RecordingError(f"{place} holds no samples of sensor units: {way_out}.")
    return SkinTrace({unit: unit_trace(received) for unit, received in samples.items()}, contents.complete)


def _received(place: Path, message: Any, ids: list[str]) -> Received:
    body = message.datagram.tobytes()
    sample = sample_of(body) if len(body) >= SAMPLE_LEAST - TAG_SIZE else None
    if sample is None:
        raise RecordingError(f"{place} holds a datagram of {message.unit} that is no sample: use a copy that is whole.")
    unit = ids.index(message.unit)
    return Received(unit, message.arrival, message.stamp, message.offset, message.bound, sample)


def unit_trace(samples: list[Received]) -> UnitTrace:
    """Return the measurements that the datagrams of one unit hold."""
    batches = []
    for one in samples:
        with suppress(ValueError):  # full scales that the sensor does not have
            batches.append((one, *imu_values(one.sample.imu, one.sample.imu_scale)))
    used = [one for one, *_ in batches if one.sample.imu_count]
    index, count, time, age = (
        np.array([getattr(one.sample, name) for one in used], np.uint64).astype(np.int64)
        for name in ("imu_index", "imu_count", "time_us", "imu_age_us")
    )
    stamp = instants(ImuCounters(index, count, time, age, _times(used, "offset"), _times(used, "bound")))
    scales = [counts_of(one.sample.imu_scale) for one in used]
    full = [LARGEST_COUNT * min(lsb) for lsb in zip(*scales, strict=True)] or [np.inf, np.inf]
    values = (np.concatenate([np.zeros((0, 3)), *(batch[k] for batch in batches)]) for k in (1, 2))
    return UnitTrace(samples, ImuTrace(stamp, *values), *full)


def _times(samples: list[Received], name: str) -> FloatArray:
    return np.array([getattr(one, name) for one in samples], dtype=np.float64)
