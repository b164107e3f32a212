"""Serves the gripper at a port of its own: one client, commands by TCP, states by UDP. It has no thread of its own."""

import math
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pretouch_fci.arm import ServedArm
from pretouch_fci.connections import READS_BEFORE_REFUSAL, Connection, Disconnected, Listener, Request
from pretouch_fci.gripper import HOMING, MAX_WIDTH_M, Course, Outcome, grasp_of, move_of
from pretouch_fci.wire import GRASP, GRIPPER, GRIPPER_STATE, MOVE_FINGERS

_PERIOD_MS = 10
"""Time of the gripper from one state to the next [ms]. The vendor publishes none; its clients wait for a second."""
_TEMPERATURE_C = 30
"""Always as warm [deg C]."""


class GripperServer:
    """Serves the gripper of one arm, within the loop of the arm's server: `sockets` and `due` say when to call `serve`.

    While it has a client its time is that of the machine's clock, less what the machine was late, in lockstep too: a
    program may ask for a state of the gripper while the arm waits for its command. In lockstep a command takes its
    whole way at once, so that what the arm carries does not depend on a clock.
    """

    def __init__(self, address: tuple[str, int], arm: ServedArm, lockstep: bool, say: Callable[[str], None]) -> None:
        """Listen; an address that cannot be had is a RobotError."""
        self._arm, self._lockstep, self._say = arm, lockstep, say
        self._listener = Listener(*address)
        self.address: tuple[str, int] = self._listener.sock.getsockname()
        """Where it listens."""
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind((address[0], 0))
        self._udp.setblocking(False)
        self._client: Connection | None = None
        self._client_udp = ("", 0)
        self._running: Request | None = None
        self._time_ms = 0
        self.due = math.inf
        """When it is to be served, though nothing has come [s], of the machine's clock."""

    @property
    def sockets(self) -> list[socket.socket]:
        """Where something may come."""
        client = [] if self._client is None else [self._client.sock]
        return [self._listener.sock, *client, *(waiting.sock for waiting in self._listener.waiting)]

    def serve(self, ready: list[Any]) -> None:
        """Serve those sockets at which something has come, and send a state when one is due."""
        if self._client is not None and self._client.sock in ready:
            self._read()
        if self._listener.sock in ready:
            for _ in range(READS_BEFORE_REFUSAL):  # a client that has gone makes room for the next
                self._read()
            self._listener.admit(taken=self._client is not None)
        for connection in [waiting for waiting in self._listener.waiting if waiting.sock in ready]:
            self._greet(connection)
        now = time.monotonic()
        if now >= self.due:
            self.due = max(self.due + _PERIOD_MS / 1000, now)  # a machine that is late leaves the time out
            self._attempt(self._pass_time)
            self._send_state()

    def close(self) -> None:
        """Disconnect the client and stop listening."""
        if self._client is not None:
            self._client.close()
        self._listener.close()
        self._udp.close()

    def _greet(self, connection: Connection) -> None:
        greeting = self._listener.greet(connection, GRIPPER, self._say)
        if greeting is not None:
            self._client, self._client_udp, self.due = connection, greeting.udp, time.monotonic()
            self._say(f"Client {connection.peer} of the gripper connected.")
            self._attempt(lambda: self._follow(greeting.requests))

    def _read(self) -> None:
        client = self._client
        if client is not None:
            self._attempt(lambda: self._follow(client.requests(GRIPPER)))

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

    def _send_state(self) -> None:
        if self._client is None:
            return
        self._time_ms += _PERIOD_MS
        gripper = self._arm.gripper
        told = (self._time_ms % 2**32, gripper.width, MAX_WIDTH_M, gripper.grasped, _TEMPERATURE_C)
        try:
            self._udp.sendto(GRIPPER_STATE.pack(*told), self._client_udp)
        except OSError:  # nobody there any more: its TCP connection tells
            return

    def _attempt(self, do: Callable[[], None]) -> None:
        """Do something for the client; disconnect it if that fails. The fingers stop, and hold what they hold."""
        try:
            do()
        except Disconnected as why:
            if self._client is None:
                return
            self._say(f"Client {self._client.peer} of the gripper disconnected: {why}.")
            self._client.close()
            self._client, self._running, self.due = None, None, math.inf
            self._arm.carry(replace(self._arm.gripper, course=None))
