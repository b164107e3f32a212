"""What `pretouch skin monitor --record` and `pretouch skin calibrate` write of what they see."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict

from pretouch.recording.skin_recording import Diagnosis, Level, SkinRecording
from pretouch.units.monitor import MonitorUpdate
from pretouch.units.receiver import SkinReceiver
from pretouch.units.traffic import Received, imu_batch
from pretouch.units.wire import Flag

_LEVELS = {"warning": Level.WARN, "fault": Level.ERROR}


def record(recording: SkinRecording, update: MonitorUpdate, receiver: SkinReceiver, diagnose: bool) -> None:
    """Record the samples of an update and, if asked for, the health of the units."""
    record_samples(recording, update.heard, [unit.id for unit in receiver.units])
    if diagnose:
        recording.health(update.time, _diagnoses(update))


def record_samples(recording: SkinRecording, heard: Iterable[Received], ids: Sequence[str]) -> None:
    """Keep samples of the units of these ids, in their order in the skin, with what their IMUs measured."""
    for one in heard:
        recording.sample(ids[one.unit], one, bool(one.sample.flags & Flag.RANGE_NEW))
        batch = imu_batch(one)
        if batch is not None:
            recording.imu(ids[one.unit], batch.stamp, batch.acceleration, batch.angular_velocity)


def _diagnoses(update: MonitorUpdate) -> list[Diagnosis]:
    rows = []
    for unit in update.units:
        found = [f for f in update.findings if f.unit == unit.unit]
        level = max((_LEVELS[f.level] for f in found), default=Level.OK)
        values = {name: str(value) for name, value in asdict(unit).items() if name not in ("unit", "standing")}
        rows.append(Diagnosis(unit.unit, level, " ".join(f.sentence for f in found) or "Nothing is wrong.", values))
    return rows
