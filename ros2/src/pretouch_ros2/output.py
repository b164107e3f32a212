"""Publisher of the controller's steps: a `Recorder` that never keeps the control loop waiting."""

from queue import SimpleQueue
from threading import Thread
from time import monotonic, time_ns

from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.types import Mode
from pretouch_ros2.messages import CLOUD, DIAGNOSTICS, STATUS, TEXT, TRANSFORMS, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.step_messages import Stamp, StepMessages

_TOPICS = "/pretouch"
"""Prefix of our topics."""
_PERIOD_S = 0.04
"""Least time between two steps that are published; contacts and changes of the mode always are [s]."""
_DIAGNOSTICS_S = 1.0
"""The same of /diagnostics [s]."""
_WAITING_MOST = 16
"""Steps that may wait to be published; more are left out."""


class Ros2Output:
    """Publishes control steps by a thread of its own; a context manager.

    Contacts and changes of the mode are published each, the rest at a limited rate. Stamps are of the time of day, when
    a step was taken.
    """

    def __init__(self, controller: Controller, node: Ros2Node, base_frame: str = "") -> None:
        """Take whose steps are published, the node, and the name of the base frame; '': the model's first link."""
        self._step_messages = StepMessages(controller, node.messages, base_frame)
        self._messages = node.messages
        self._next = self._next_diagnostics = 0.0
        self._mode: Mode | None = None
        self._published: Mode | None = None
        self.dropped = 0
        """Steps left out because the thread was busy."""
        self.failure = ""
        """Reason why nothing is published any more, as a sentence, or ''."""
        self._queue: SimpleQueue[tuple[Cycle, Stamp] | None] = SimpleQueue()
        self._cloud = node.publisher(f"{_TOPICS}/obstacles", CLOUD)
        self._force = node.publisher(f"{_TOPICS}/force", WRENCH)
        self._contact = node.publisher(f"{_TOPICS}/contact", WRENCH)
        self._mode_text = node.publisher(f"{_TOPICS}/mode", TEXT, latched=True, depth=1)
        self._limited = node.publisher(f"{_TOPICS}/limited", STATUS)
        self._diagnostics = node.publisher("/diagnostics", DIAGNOSTICS)
        units = node.publisher("/tf_static", TRANSFORMS, latched=True, depth=1)
        units.publish(self._step_messages.units(_now()))
        self._thread = Thread(target=self._work, name="ros2-output", daemon=True)
        self._thread.start()

    def record(self, cycle: Cycle) -> None:
        """Have a turn of the loop published, if it is time."""
        now, step = monotonic(), cycle.step
        if self.failure or (now < self._next and step.contact is None and step.mode is self._mode):
            return
        if now >= self._next:
            self._next = now + _PERIOD_S
        self._mode = step.mode
        if self._queue.qsize() >= _WAITING_MOST:
            self.dropped += 1
            return
        self._queue.put((cycle, _now()))

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the published messages for a person, a sentence each."""
        dropped = f"{self.dropped} control steps were not published: the machine was busy." if self.dropped else ""
        return tuple(filter(None, (self.failure, dropped)))

    def close(self) -> None:
        """Publish what waits, and end."""
        self._queue.put(None)
        self._thread.join()

    def _work(self) -> None:
        while (item := self._queue.get()) is not None:
            try:
                self._publish(*item)
            except Exception as error:  # the arm goes on: a person is told at the end
                self.failure = f"Publishing control steps failed: {type(error).__name__}: {error}"
                return

    def _publish(self, cycle: Cycle, at: Stamp) -> None:
        step, step_messages = cycle.step, self._step_messages
        if step.contact is not None:
            self._contact.publish(step_messages.wrench(step.contact.force, at))
        self._force.publish(step_messages.wrench(step.force, at))
        self._limited.publish(step_messages.limited(step))
        self._cloud.publish(step_messages.cloud(step, at))
        self._mode_text.publish(self._messages.make(TEXT, f"{step.mode.name}: {step.reason}"))
        now, changed = monotonic(), step.mode is not self._published
        self._published = step.mode
        if changed or now >= self._next_diagnostics:
            self._next_diagnostics = now + _DIAGNOSTICS_S
            self._diagnostics.publish(step_messages.diagnostics(cycle, at))


def _now() -> Stamp:
    """Return the time of day."""
    return divmod(time_ns(), 10**9)
