"""Recording of sensor units without a controller: one MCAP file for the usual viewers and for calibration."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np

from pretouch.errors import RecordingError
from pretouch.recording.disk import Disk, Item
from pretouch.recording.ros import IMU, JOINT_STATE, RANGE, UNIT_SAMPLE, messages
from pretouch.recording.viewer_topics import header, item, nanoseconds, range_item, topic_name
from pretouch.types import FloatArray
from pretouch.units.unit import Received, imu_batch
from pretouch.units.wire import Flag

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
