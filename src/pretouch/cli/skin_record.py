"""What `pretouch skin monitor --record` writes of what it sees."""

from dataclasses import asdict

from pretouch.hardware.monitor import Turn
from pretouch.hardware.receiver import SkinReceiver
from pretouch.hardware.traffic import imu_batch
from pretouch.hardware.wire import Flag
from pretouch.recording.skin_recording import Diagnosis, Level, SkinRecording

_LEVELS = {"warning": Level.WARN, "fault": Level.ERROR}


def record(recording: SkinRecording, turn: Turn, receiver: SkinReceiver, diagnose: bool) -> None:
    """Keep the samples of a turn, and if asked for how the units are."""
    for heard in turn.heard:
        unit = receiver.units[heard.unit].id
        recording.sample(unit, heard, bool(heard.sample.flags & Flag.RANGE_NEW))
        batch = imu_batch(heard)
        if batch is not None:
            recording.imu(unit, batch.stamp, batch.acceleration, batch.angular_velocity)
    if diagnose:
        recording.health(turn.time, _diagnoses(turn))


def _diagnoses(turn: Turn) -> list[Diagnosis]:
    rows = []
    for unit in turn.units:
        found = [f for f in turn.findings if f.unit == unit.unit]
        level = max((_LEVELS[f.level] for f in found), default=Level.OK)
        values = {name: str(value) for name, value in asdict(unit).items() if name not in ("unit", "standing")}
        rows.append(Diagnosis(unit.unit, level, " ".join(f.sentence for f in found) or "Nothing is wrong.", values))
    return rows
