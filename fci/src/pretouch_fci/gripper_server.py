"""Serves the gripper at a port of its own: one client, commands by TCP, states by UDP. It has no thread of its own."""

import math
import time
from collections.abc import Callable, Container
from dataclasses import replace

from pretouch_fci.arm import ServedArm
from pretouch_fci.connections import ClientPort, Connection, Disconnected, Request
from pretouch_fci.gripper import HOMING, MAX_WIDTH_M, Course, Outcome, grasp_of, move_of
from pretouch_fci.wire import GRASP, GRIPPER, GRIPPER_STATE, MOVE_FINGERS

_PERIOD_MS = 10
"""Time of the gripper from one state to the next [ms]. The vendor publishes none; its clients wait for a second."""
_TEMPERATURE_C = 30
"""Always as warm [deg C]."""


class GripperServer(ClientPort):
    """Serves the gripper of one arm, within the loop of the arm's server: `sockets` and `due` say when to call `serve`.

    While it has a client its time is that of the machine's clock, less what the machine was late, in lockstep too: a
    program may ask for a state of the gripper while the arm waits for its command. In lockstep a command takes its
    whole way at once, so that what the arm carries does not depend on a clock.
    """

    def __init__(self, address: tuple[str, int], arm: ServedArm, lockstep: bool, say: Callable[[str], None]) -> None:
        """Listen; an address that cannot be had is a RobotError."""
        super().__init__(*address, GRIPPER, say, " of the gripper")
        self._arm, self._lockstep = arm, lockstep
        self._running: Request | None = None
        self._time_ms = 0
        self.due = math.inf
        """Time to serve it though nothing has arrived [s], by the machine's clock."""

    def serve(self, ready: Container[object]) -> None:
        """Serve those sockets at which something has come, and send a state when one is due."""
        self._serve_ready(ready)
        now = time.monotonic()
        if now >= self.due:
            self.due = max(self.due + _PERIOD_MS / 1000, now)  # a machine that is late leaves the time out
            self._attempt(self._pass_time)
            self._time_ms += _PERIOD_MS
            gripper = self._arm.gripper
            state = (self._time_ms % 2**32, gripper.width, MAX_WIDTH_M, gripper.grasped, _TEMPERATURE_C)
            self._send(GRIPPER_STATE.pack(*state))

    def _came(self, client: Connection) -> None:
        self.due = time.monotonic()

    def _gone(self) -> None:
        """Stop the fingers; they hold what they hold."""
        self._running, self.due = None, math.inf
        self._arm.carry(replace(self._arm.gripper, course=None))

    def _follow(self, requests: list[Request]) -> None:
        for request in requests:
            match request.name:
                case "Connect":
                    raise Disconnected("asks to connect once more")
                case "Stop":
                    self._abort()
                    self._answer(request, Outcome.SUCCESS)
                case "Homing":
                    self._begin(request, HOMING)
                case "Grasp":
                    self._begin(request, grasp_of(*GRASP.unpack(request.body)))
                case "Move":
                    self._begin(request, move_of(*MOVE_FINGERS.unpack(request.body)))

    def _begin(self, request: Request, course: Course | None) -> None:
        """Begin to follow a command, in place of another; there may be no such command."""
        if course is None:
            self._answer(request, Outcome.FAIL)
            return
        self._abort()
        self._running = request
        self._arm.carry(replace(self._arm.gripper, course=course))
        while self._lockstep and self._running is not None:
            self._pass_time(math.inf)

    def _abort(self) -> None:
        self._arm.carry(replace(self._arm.gripper, course=None))
        self._end(Outcome.ABORTED)

    def _pass_time(self, seconds: float = _PERIOD_MS / 1000) -> None:
        """Let the fingers move for a time [s], and answer a command that has ended."""
        gripper, outcome = self._arm.gripper.step(seconds)
        self._arm.carry(gripper)
        if outcome is not None:
            self._end(outcome)

    def _end(self, outcome: Outcome) -> None:
        request, self._running = self._running, None
        if request is not None:
            self._answer(request, outcome)

    def _answer(self, request: Request, outcome: Outcome) -> None:
        if self._client is not None:
            self._client.send(GRIPPER.reply(request.name, request.identifier, GRIPPER.status.pack(outcome)))
