"""The files of a run: a recording, if one is asked for, and the last seconds before each HOLD that latches."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from pretouch.controller import Controller
from pretouch.loop import Cycle, Recorder
from pretouch.recording.last_seconds import LastSeconds
from pretouch.recording.writer import Recording
from pretouch.session.free_motion import FreeMotion


@dataclass(frozen=True)
class RunFiles:
    """What records a run."""

    recorder: Recorder
    """To be given each cycle."""
    recording: Recording | None
    last_seconds: LastSeconds
    learnt: FreeMotion | None

    @property
    def trouble(self) -> str:
        """Why the recording that was asked for is not whole, as a sentence, or ''."""
        return self.recording.trouble if self.recording else ""

    def close(self) -> tuple[str, ...]:
        """Finish the files; return a sentence on each."""
        said = list(self.learnt.keep()) if self.learnt else []
        self.last_seconds.close()
        said += [f"The last seconds before a HOLD: {place}" for place in self.last_seconds.written]
        said += [self.last_seconds.trouble] if self.last_seconds.trouble else []
        return (*said, self.recording.close().sentence) if self.recording else tuple(said)


@contextmanager
def open_run_files(
    controller: Controller,
    robot: str,
    place: Path | None,
    folder: Path,
    tell: Callable[[str], None],
    learnt: FreeMotion | None = None,
    further: Recorder | None = None,
) -> Iterator[RunFiles]:
    """Open the files of a run.

    Args:
        controller: that moves the arm.
        robot: what the arm is called.
        place: recording to write, if any.
        folder: for the last seconds before each HOLD that latches.
        tell: is called at once, without waiting, when the recording fails.
        learnt: what keeps free motion, if anything does.
        further: what else is given each cycle, if anything.
    """
    with ExitStack() as stack:
        recording = stack.enter_context(Recording(place, controller, {"robot": robot})) if place else None
        last = stack.enter_context(LastSeconds(controller, folder, recording, about={"robot": robot}))
        supervisor = _RecordingSupervisor(recording, tell) if recording else None
        yield RunFiles(
            RecorderGroup([one for one in (last, learnt, further, supervisor) if one]), recording, last, learnt
        )


class RecorderGroup:
    """Several recorders as one, or none."""

    def __init__(self, recorders: Sequence[Recorder]) -> None:
        self._recorders = recorders

    def record(self, cycle: Cycle) -> None:
        """Keep one turn of the loop."""
        for recorder in self._recorders:
            recorder.record(cycle)


class _RecordingSupervisor:
    """Reports once that the recording fails."""

    def __init__(self, recording: Recording, tell: Callable[[str], None]) -> None:
        self._recording, self._tell, self._notified = recording, tell, False

    def record(self, cycle: Cycle) -> None:
        """Check the recording."""
        if not self._notified and self._recording.trouble:
            self._notified = True
            self._tell(self._recording.trouble)
