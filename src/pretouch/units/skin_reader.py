"""Reader of recordings of sensor units: each unit's measurements as arrays."""

from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.calibration.stamps import ImuCounters, instants
from pretouch.errors import RecordingError
from pretouch.recording.mcap_file import Contents, chunks, open_mcap
from pretouch.recording.ros import JOINT_STATE, UNIT_SAMPLE, check_version, decoded
from pretouch.sensing.unit import LARGEST_COUNT, counts_of
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray, IntArray
from pretouch.units.unit import Received
from pretouch.units.wire import SAMPLE_LEAST, TAG_SIZE, imu_values, sample_of


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
    joints: JointTrace | None
    """Joint positions of the arm, if they were recorded."""
    joint_names: tuple[str, ...]
    """Names of these joints, in the order of the columns."""
    complete: bool
    """True if the recording was ended in order."""


def read_skin(place: Path) -> SkinTrace:
    """Read a file of `SkinRecording`, complete or cut off. RecordingError for any other file."""
    place, contents, way_out = Path(place), Contents(), "give a recording made by `pretouch skin monitor --record`"
    samples: dict[str, list[Received]] = {}
    states: list[Any] = []
    with open_mcap(place, way_out) as file:
        for message in chain.from_iterable(messages for _, messages in chunks(file, contents)):
            if message.kind == JOINT_STATE:
                states.append(decoded(JOINT_STATE, message.data))
            elif message.kind == UNIT_SAMPLE:
                if not samples:
                    check_version(place, contents)
                datagram = decoded(UNIT_SAMPLE, message.data)
                samples.setdefault(datagram.unit, []).append(_received(place, datagram, list(samples)))
    if not samples:
        raise RecordingError(f"{place} holds no samples of sensor units: {way_out}.")
    joints, names = _joints(place, states)
    return SkinTrace(
        {unit: unit_trace(received) for unit, received in samples.items()}, joints, names, contents.complete
    )


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
    index, count, time, age = (_column(used, name) for name in ("imu_index", "imu_count", "time_us", "imu_age_us"))
    stamp = instants(ImuCounters(index, count, time, age, _times(used, "offset"), _times(used, "bound")))
    scales = [counts_of(one.sample.imu_scale) for one in used]
    full = [LARGEST_COUNT * min(lsb) for lsb in zip(*scales, strict=True)] or [np.inf, np.inf]
    values = (np.concatenate([np.zeros((0, 3)), *(batch[k] for batch in batches)]) for k in (1, 2))
    return UnitTrace(samples, ImuTrace(stamp, *values), *full)


def _column(samples: list[Received], name: str) -> IntArray:
    return np.array([getattr(one.sample, name) for one in samples], dtype=np.uint64).astype(np.int64)


def _times(samples: list[Received], name: str) -> FloatArray:
    return np.array([getattr(one, name) for one in samples], dtype=np.float64)


def _joints(place: Path, states: list[Any]) -> tuple[JointTrace | None, tuple[str, ...]]:
    """Return positions by time, the later ones of two at one instant, and the joints' names.

    Those that are not one number for each joint are left out. States of several arms are a RecordingError.
    """
    names = tuple(dict.fromkeys(tuple(state.name) for state in states))
    if len(names) > 1:
        one, other = (", ".join(joints) for joints in names[:2])
        raise RecordingError(f"{place} has states of the joints {other} and of {one}: record one arm per file.")
    sound = [s for s in states if s.position.shape == (len(s.name),) and np.isfinite(s.position).all()]
    if not sound:
        return None, names[0] if names else ()
    stamp = np.array([s.header.stamp.sec + s.header.stamp.nanosec / 1e9 for s in sound])
    order = np.argsort(stamp, kind="stable")
    order = order[np.append(np.diff(stamp[order]) > 0, True)]
    return JointTrace(stamp[order], np.stack([s.position for s in sound])[order]), names[0]
