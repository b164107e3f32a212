"""Where a live page puts its recordings, and the button that begins and ends them."""

from pathlib import Path

from pretouch.errors import RecordingError
from pretouch.viewer.simulation import LiveSimulation

RECORDINGS = Path("runs")
"""Folder in which recordings are kept."""


def fresh_place(folder: Path) -> Path:
    """A file in the folder that is not there yet."""
    number = 1
    while (place := folder / f"live-{number}.mcap").exists():
        number += 1
    return place


def toggle_recording(simulation: LiveSimulation) -> None:
    """Begin a recording in a file of its own, or end the one under way; the simulation's notice says where it is.

    A RecordingError says why none can be begun.
    """
    if simulation.recording is not None:
        closed = simulation.stop_recording()
        simulation.notice = closed.sentence if closed else ""
        return
    try:
        RECORDINGS.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"The folder {RECORDINGS} cannot be made: {error.strerror}.") from error
    place = fresh_place(RECORDINGS)
    simulation.start_recording(place)
    simulation.notice = f"Recording to {place}."
