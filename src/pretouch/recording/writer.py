"""A run, recorded as it goes on: one MCAP file that recomputes each control step and opens in the usual viewers."""

import atexit
import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Self

import numpy as np

from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.recording.codec import (
    DESIRED,
    INPUTS,
    MOVING,
    PAYLOAD,
    POINTS,
    STEP,
    TOUCH,
    TRUTH,
    encode_desired,
    encode_inputs,
    encode_moving,
    encode_payload,
    encode_points,
    encode_step,
    encode_touch,
    encode_truth,
)
from pretouch.recording.disk import Disk, Item
from pretouch.recording.messages import TOPICS, prepare
from pretouch.recording.plain import JSON
from pretouch.recording.scene import DRAWN, Scene
from pretouch.recording.setting import RUN, encode_run, is_described
from pretouch.recording.standard import STANDARD, Standard, imu_items, nanoseconds
from pretouch.recording.state_codec import STATE, encode_state
from pretouch.recording.truth import Truth
from pretouch.robot.model import RobotModel
from pretouch.signals import ended_in_order
from pretouch.types import ControlStep, FloatArray, SeenPoints

SNAPSHOT_S = 3.0
"""Time between two snapshots of the controller's state [s]."""

_FASTER = 1.2
"""A run whose time passes this much faster than the clock's is a simulation."""


@dataclass(frozen=True)
class Closed:
    """What a recording became."""

    place: Path
    steps: int
    duration_s: float
    """From the first step to the last [s]."""
    sentence: str
    """How it ended, for a person to read."""


class Recording:
    """One MCAP file that a run is written to while it goes on; a recorder of `loop.run`, and a context manager.

    `record` encodes and hands over; a thread compresses and writes, about twice a second. A killed process loses what
    was not written by then. Within `with`, SIGTERM and SIGHUP raise SystemExit where nobody else handles them, so that
    the file is closed. A file that is there already is never written over: RecordingError.
    """

    def __init__(self, place: Path, controller: Controller, about: Mapping[str, JSON] | None = None) -> None:
        """Begin a file for what a controller does.

        Args:
            place: file to make; its folder must be there.
            controller: whose cycles will be recorded.
            about: what else is to be known of the run, as JSON has it; `scene` with `boxes` is drawn by viewers.
        """
        self.place = Path(place)
        self._about = dict(about or {})
        self._steps = 0
        self._first = self._last = self._begun_at = math.nan
        self._log_time = 0
        self._closed: Closed | None = None
        self._points: tuple[SeenPoints | None, int] = None, 0
        """Those written last, and the number of the step that they are with."""
        self._as_context = ExitStack()
        self._model: RobotModel | None = None
        """For the thread: one model serves one thread."""
        prepare(TOPICS.values(), STANDARD, DRAWN)
        self._take(controller)
        self._disk = Disk(self.place)
        atexit.register(self.close)

    def _take(self, controller: Controller) -> None:
        self._begun: bytes | None = encode_run(self._steps, controller, self._about)
        arm = controller.model.description
        if self._model is None or self._model.description is not arm:
            self._model = RobotModel(arm)
        self._standard, self._scene = Standard(controller), Scene(controller, self._about, self._model)
        self._snapshot_due = -math.inf
        self._command: FloatArray | None = None
        """Of the last step; None where the next one cannot be recomputed from it."""
        self._path = None if is_described(controller.path) else controller.path

    def change(self, controller: Controller) -> None:
        """Let the steps from the next one on be those of another controller of the same arm."""
        self._take(controller)

    def record(self, cycle: Cycle, truth: Truth | None = None) -> None:
        """Keep one turn of the loop, and what only a simulation knows. Of the disk's troubles it raises none."""
        if self._closed is not None or self.trouble:
            return
        number, step = self._steps, cycle.step
        self._log_time = time = nanoseconds(step.stamp, self._log_time)
        items: list[Item] = []
        if self._begun is not None:
            items.append(Item("/pretouch/run", RUN, number, time, self._begun))
            self._begun = None
        anew = not self._goes_on(cycle)
        if anew or not self._last <= step.stamp < self._snapshot_due:
            items.append(Item("/pretouch/state", STATE, number, time, encode_state(number, cycle.before, anew)))
            self._snapshot_due = step.stamp + SNAPSHOT_S
        data, whole = encode_inputs(number, cycle.inputs)
        touch = encode_touch(number, cycle.inputs) if whole else None
        if touch is not None:
            items.append(Item("/pretouch/touch", TOUCH, number, time, touch))
        moving = encode_moving(number, cycle.inputs) if whole else None
        if moving is not None:
            items.append(Item("/pretouch/moving", MOVING, number, time, moving))
        payload = encode_payload(number, cycle.inputs) if whole else None
        if payload is not None:
            items.append(Item("/pretouch/payload", PAYLOAD, number, time, payload))
        desired = encode_desired(number, cycle.inputs) if whole else None
        if desired is not None:
            items.append(Item("/pretouch/desired", DESIRED, number, time, desired))
        self._command = step.command if whole else None
        items.append(Item("/pretouch/inputs", INPUTS, number, time, data))
        points = cycle.inputs.points if whole else None
        if points is not None:
            if points is not self._points[0]:
                self._points = points, number
            data_of_points = encode_points(number, points, self._points[1])
            items.append(Item("/pretouch/seenpoints", POINTS, number, time, data_of_points))
        tangent = self._tangent(step.path_phase)
        items.append(Item("/pretouch/step", STEP, number, time, encode_step(number, step, tangent)))
        if truth is not None:
            items.append(Item("/pretouch/truth", TRUTH, number, time, encode_truth(number, truth)))
        given = data if whole else None
        self._disk.put(partial(_messages, items, self._standard, self._scene, given, step, number, time))
        if not self._steps:
            self._first, self._begun_at = step.stamp, monotonic()
        elif self._disk.behind() and step.stamp - self._first > _FASTER * (monotonic() - self._begun_at):
            self._disk.wait()  # a simulation that outruns the clock can wait, a control loop cannot
        self._steps, self._last = number + 1, step.stamp

    def _goes_on(self, cycle: Cycle) -> bool:
        """Whether a cycle began with what the one before left, and that can be recomputed."""
        before, command = cycle.before, self._command
        return command is not None and before.watch.stamp == self._last and bool((before.command == command).all())

    def _tangent(self, phase: float) -> FloatArray | None:
        return None if self._path is None else np.array(self._path.tangent(phase), dtype=np.float64)

    def imu(self, unit_id: str, stamp: FloatArray, acceleration: FloatArray, angular_velocity: FloatArray) -> None:
        """Keep what a unit's IMU measured at instants (M,) [s]: (M, 3) [m/s^2], (M, 3) [rad/s], sensor frame."""
        if self._closed is None and not self.trouble:
            self._disk.put(partial(imu_items, unit_id, self._log_time, stamp, acceleration, angular_velocity))

    @property
    def trouble(self) -> str:
        """'' or, once nothing more can be written, a sentence that says why and what the file holds."""
        return self._disk.trouble

    def close(self) -> Closed:
        """End the file; a second time says the same again."""
        if self._closed is None:
            self._disk.close()
            self._closed = self._summary()
            atexit.unregister(self.close)
        return self._closed

    def _summary(self) -> Closed:
        duration = self._last - self._first if self._steps else 0.0
        size = self._disk.size()
        sentence = self.trouble or (
            f"{self.place} holds {self._steps} control steps, {duration:.1f} s, in {size / 1e6:.1f} MB."
        )
        return Closed(self.place, self._steps, duration, sentence)

    def __enter__(self) -> Self:
        self._as_context.enter_context(ended_in_order())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        self._as_context.close()


def _messages(
    items: list[Item],
    standard: Standard,
    scene: Scene,
    inputs: bytes | None,
    step: ControlStep,
    number: int,
    time: int,
) -> Iterator[Item]:
    """Yield the messages of a cycle, and what it is to tools that do not know our types."""
    yield from items
    yield from standard.items(inputs, step, number, time)
    yield from scene.drawn(step, number, time)
