"""A recording of a killed run, made into a file that opens everywhere."""

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from pretouch.errors import RecordingError
from pretouch.recording.container import Contents, begins_as_mcap, scan
from pretouch.recording.ending import Index, ending, entry, header, in_chunk
from pretouch.recording.messages import LIBRARY
from pretouch.recording.reader import open_recording
from pretouch.recording.skin_reader import holds_units, read_skin


@dataclass(frozen=True)
class Recovered:
    """What recovering a recording gave."""

    place: Path
    """The file that opens everywhere: a new one, or the given one if it was complete."""
    steps: int
    """Control steps it holds, or samples of sensor units."""
    said: str
    """What was done, for a person to read."""


def recover(place: Path, out: Path | None = None) -> Recovered:
    """Write all that is whole of a recording to another file, with the index that was missing.

    The recording stays as it is. The other file is by default `NAME.recovered.mcap` beside it; one that is there
    already is a RecordingError, as is a file that holds no recording.
    """
    place = Path(place)
    complete, steps, what, duration = _held(place)
    if complete:
        return Recovered(place, steps, f"{place} is complete, with {steps} {what}: there is nothing to recover.")
    out = Path(out) if out is not None else place.with_name(f"{place.name.removesuffix('.mcap')}.recovered.mcap")
    try:
        with place.open("rb") as source, out.open("xb") as target:
            try:
                _copy(source, target)
            except BaseException:
                out.unlink()
                raise
    except FileExistsError as error:
        raise RecordingError(f"{out} exists already: give another name, or move it.") from error
    except OSError as error:
        raise RecordingError(f"The recovered recording {out} cannot be written: {error.strerror}.") from error
    return Recovered(out, steps, f"{out} holds the intact part of {place}: {steps} {what}, over {duration:.2f} s.")


def _held(place: Path) -> tuple[bool, int, str, float]:
    """Whether a recording is complete, how many of what it holds, and over what time [s]."""
    if holds_units(place):
        units = read_skin(place)
        return units.complete, units.samples, "samples of sensor units", units.duration
    recorded = open_recording(place)
    stamps = recorded.stamps()
    return recorded.complete, len(recorded), "control steps", float(stamps[-1] - stamps[0])


def _copy(source: BinaryIO, target: BinaryIO) -> None:
    """Write a file of all schemas and channels, the whole chunks, and their index."""
    contents, index = Contents(), Index()
    begins_as_mcap(source)
    for _ in scan(source, contents):
        pass  # what channels there are may only stand behind the chunk that first needs them
    target.write(header(contents.profile or "ros2", LIBRARY))
    for record in contents.definitions():
        target.write(record)
    source.seek(0)
    begins_as_mcap(source)
    for chunk in scan(source, Contents()):
        whole = in_chunk(chunk)
        made = entry(whole, target.tell())
        target.write(whole.record + made.index)
        index.add(made)
    target.write(ending(contents, index, target.tell()))
