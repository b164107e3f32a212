"""What a skin can be calibrated from, out of a recording of either kind: an arm's joints, and units' IMUs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pretouch.recording.mcap_file import Contents, read_messages
from pretouch.recording.reader import Recorded, open_recording
from pretouch.recording.ros import IMU, decoded
from pretouch.recording.skin_reader import ImuRows, JointRows, holds_units, read_skin
from pretouch.recording.skin_recording import KeptSample
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import ACCELERATION_LSB, ANGULAR_RATE_LSB, LARGEST_COUNT
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_ACCELERATION_LSB = np.array(list(ACCELERATION_LSB.values()))
_ANGULAR_VELOCITY_LSB = np.array(list(ANGULAR_RATE_LSB.values()))
"""One count by the codes of scales in datagrams [m/s^2], [rad/s]."""


@value
class ImuCounters:
    """What tells when IMU samples were taken: B batches of one unit, in the order in which they came."""

    index: IntArray
    """(B,) number of the first sample of each since the unit's reset."""
    count: IntArray
    """(B,) how many samples each has."""
    time_us: IntArray
    """(B,) unit's clock when the datagram was made [us]."""
    imu_age_us: IntArray
    """(B,) from the newest sample to `time_us` [us]."""
    offset: FloatArray
    """(B,) the receiver's time minus the unit's [s]; NaN while that was not known."""
    bound: FloatArray
    """(B,) most the true offset differs from it [s]."""


@dataclass(frozen=True, eq=False)
class MeasuredUnit:
    """What one unit's IMU measured."""

    imu: ImuTrace
    """With counters: in the order of their batches, at stamps that are spaced by the nominal rate, and NaN where the
    unit's clock was not known. Without: by time, as recorded."""
    counters: ImuCounters | None
    """None in the recording of a run, which has stamps only."""
    acceleration_max: float = np.inf
    """Largest that the accelerometer could tell [m/s^2]; inf if that is not known."""
    angular_velocity_max: float = np.inf
    """Largest that the gyroscope could tell [rad/s]."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured on an arm. All times are of one clock, but for the units' unknown delays."""

    joints: JointTrace | None
    """None if no joint states were recorded."""
    joint_names: tuple[str, ...]
    """Names of these joints, in the order of the columns."""
    units: dict[str, MeasuredUnit]
    """By name: those that have an IMU."""
    skin: Skin | None
    """The skin that a run began with; None in a recording of units alone."""
    complete: bool
    """Whether the recording was ended in order."""


def read_measured(place: Path) -> Measured:
    """Read a recording of units (`SkinRecording`) or of a run (`Recording`). RecordingError for any other file."""
    place = Path(place)
    if not holds_units(place):
        return _of_run(open_recording(place))
    trace = read_skin(place)
    units = {name: _of_samples(unit.samples) for name, unit in trace.units.items()}
    there = {name: unit for name, unit in units.items() if unit is not None}
    return Measured(trace.joints, trace.joint_names, there, None, trace.complete)


def _of_run(recorded: Recorded) -> Measured:
    run = recorded.runs[0]
    joints = JointRows(recorded.place, run.model.joints)
    for robot in recorded.robot_states():
        joints.add(robot.stamp, robot.q)
    units = {name: MeasuredUnit(imu, None) for name, imu in _imus(recorded.place).items()}
    return Measured(joints.trace(), joints.names, units, run.skin, recorded.complete)


def _imus(place: Path) -> dict[str, ImuTrace]:
    imus = ImuRows()
    with place.open("rb") as file:
        for message in read_messages(file, Contents()):
            if message.kind == IMU:
                imus.add(decoded(IMU, message.data))
    return imus.traces()


def _of_samples(samples: list[KeptSample]) -> MeasuredUnit | None:
    """Return what a unit's datagrams tell of its IMU; None if they hold nothing of one, or a scale it cannot have."""
    used = [s for s in samples if s.sample["imu_count"] and s.sample["imu_scale"] >> 4 & 7 < len(_ANGULAR_VELOCITY_LSB)]
    if not used:
        return None

    def column(name: str) -> IntArray:
        return np.array([s.sample[name] for s in used], dtype=np.uint64).astype(np.int64)

    counters = ImuCounters(
        index=column("imu_index"),
        count=column("imu_count"),
        time_us=column("time_us"),
        imu_age_us=column("imu_age_us"),
        offset=np.array([s.offset for s in used], dtype=np.float64),
        bound=np.array([s.bound for s in used], dtype=np.float64),
    )
    scale = column("imu_scale")
    acceleration_lsb, angular_velocity_lsb = _ACCELERATION_LSB[scale & 3], _ANGULAR_VELOCITY_LSB[scale >> 4 & 7]
    raw = np.frombuffer(b"".join(s.sample["imu"] for s in used), "<i2").reshape(-1, 6).astype(np.float64)
    imu = ImuTrace(
        _nominal(counters, column("imu_rate_hz").astype(np.float64)),
        raw[:, 3:] * np.repeat(acceleration_lsb, counters.count)[:, None],
        raw[:, :3] * np.repeat(angular_velocity_lsb, counters.count)[:, None],
    )
    return MeasuredUnit(
        imu, counters, LARGEST_COUNT * float(acceleration_lsb.min()), LARGEST_COUNT * float(angular_velocity_lsb.min())
    )


def _nominal(counters: ImuCounters, rate: FloatArray) -> FloatArray:
    """Stamps (M,) [s] of samples that came at nominal rates (B,) [Hz]; NaN where nothing tells them."""
    newest = 1e-6 * (counters.time_us - counters.imu_age_us) + counters.offset
    period = np.divide(1.0, rate, out=np.full_like(rate, np.nan), where=rate > 0)
    left = np.repeat(np.cumsum(counters.count), counters.count) - np.arange(counters.count.sum()) - 1
    return np.repeat(newest, counters.count) - left * np.repeat(period, counters.count)
