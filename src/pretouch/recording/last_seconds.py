"""The last seconds before a HOLD that lasts until a person resumes, each in a recording of its own."""

import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Protocol, Self

from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.recording.codec import (
    decode_desired,
    decode_inputs,
    decode_moving,
    decode_points,
    decode_touch,
    encode_desired,
    encode_inputs,
    encode_moving,
    encode_points,
    encode_touch,
)
from pretouch.recording.plain import JSON
from pretouch.recording.truth import Truth
from pretouch.recording.writer import Recording
from pretouch.types import SeenPoints


class Further(Protocol):
    """Another recorder, as `Recording`."""

    def record(self, cycle: Cycle, truth: Truth | None = None) -> None:
        """Keep one turn of the loop."""
        ...

    def change(self, controller: Controller) -> None:
        """Go on with another controller."""
        ...


class _Passed(NamedTuple):
    """A cycle that has passed, with its inputs as they were then: a port may use its arrays again."""

    cycle: Cycle
    truth: Truth | None
    inputs: bytes | None = None
    touch: bytes | None = None
    points: bytes | None = None
    desired: bytes | None = None
    moving: bytes | None = None

    def again(self) -> Cycle:
        if self.inputs is None:
            return self.cycle
        inputs = decode_inputs(self.inputs)[1]
        if inputs is None:
            return self.cycle
        whole = replace(
            inputs,
            touch=None if self.touch is None else decode_touch(self.touch),
            points=None if self.points is None else decode_points(self.points)[1],
            payload=self.cycle.inputs.payload,  # nobody can change it
            desired=None if self.desired is None else decode_desired(self.desired),
            moving=None if self.moving is None else decode_moving(self.moving),
        )
        return replace(self.cycle, inputs=whole)


class LastSeconds:
    """A recorder that writes `hold-1.mcap`, `hold-2.mcap`, ... to a folder as HOLDs latch, and raises nothing.

    Each file ends with the step that latched. What is recorded is handed on to another recorder, if there is one.
    """

    def __init__(
        self, controller: Controller, folder: Path, recorder: Further | None = None, seconds: float = 5.0,
        most: int = 5, about: Mapping[str, JSON] | None = None,
    ) -> None:  # fmt: skip
        """Keep the cycles of a controller.

        Args:
            controller: whose cycles will be recorded.
            folder: for the files; it is made when the first is written.
            recorder: what else records.
            seconds: how far back each file begins [s].
            most: files written at most.
            about: as for `Recording`.
        """
        self.written: list[Path] = []
        """The files so far; each is finished once `close` has returned."""
        self.trouble = ""
        """Why a file could not be written, as a sentence, or ''."""
        self._controller, self._folder, self._recorder = controller, Path(folder), recorder
        self._seconds, self._most, self._about = seconds, most, dict(about or {})
        self._ring: deque[_Passed] = deque(maxlen=max(1, round(2 * seconds / controller.limits.period)))
        self._writing: list[threading.Thread] = []
        self._points: tuple[SeenPoints | None, bytes | None] = None, None
        """Those that came last, and what is kept of them."""

    def record(self, cycle: Cycle, truth: Truth | None = None) -> None:
        """Keep one turn of the loop for a while."""
        if self._recorder is not None:
            self._recorder.record(cycle, truth)
        data, whole = encode_inputs(0, cycle.inputs)
        self._ring.append(self._passed(cycle, data, truth) if whole else _Passed(cycle, truth))
        begin = cycle.step.stamp - self._seconds
        while self._ring[0].cycle.step.stamp < begin:
            self._ring.popleft()
        if cycle.after.mode.latched and not cycle.before.mode.latched:
            self._write()

    def _passed(self, cycle: Cycle, data: bytes, truth: Truth | None) -> _Passed:
        """Return a cycle whose inputs are those of now; a set of points that stays the same is written down once."""
        given = cycle.inputs
        if given.points is not self._points[0]:
            self._points = given.points, None if given.points is None else encode_points(0, given.points, 0)
        return _Passed(
            cycle,
            truth,
            data,
            encode_touch(0, given),
            self._points[1],
            encode_desired(0, given),
            encode_moving(0, given),
        )

    def change(self, controller: Controller) -> None:
        """Let the cycles from the next one on be those of another controller of the same arm."""
        if self._recorder is not None:
            self._recorder.change(controller)
        self._controller = controller
        self._ring.clear()

    def close(self) -> None:
        """Wait for what is being written."""
        for thread in self._writing:
            thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self) -> None:
        """Have what is kept written, by a thread: the arm is braking, and its loop must not wait."""
        if not self._ring or len(self.written) + bool(self.trouble) >= self._most:
            return
        thread = threading.Thread(target=self._write_all, args=(self._controller, tuple(self._ring)))
        self._writing.append(thread)
        thread.start()

    def _write_all(self, controller: Controller, cycles: tuple[_Passed, ...]) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            number = 1
            while (place := self._folder / f"hold-{number}.mcap").exists():
                number += 1
            recording = Recording(place, controller, self._about)
            for passed in cycles:
                recording.record(passed.again(), passed.truth)
            recording.close()
            self.written.append(place)
            self.trouble = recording.trouble or self.trouble
        except Exception as error:  # the arm is stopping, and nothing may come between
            self.trouble = f"The last seconds before a HOLD were not saved: {error}"
