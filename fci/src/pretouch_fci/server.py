"""The server: one client at a time, states by UDP each millisecond, requests by TCP. One thread."""

import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np

from pretouch.checks import Check, Checked, NonNegative, Positive
from pretouch.errors import ParameterError, RobotError
from pretouch_fci.arm import ServedArm
from pretouch_fci.connections import ClientPort, Connection, Request
from pretouch_fci.frames import urdf_of
from pretouch_fci.gripper_server import GripperServer
from pretouch_fci.handler import RequestHandler
from pretouch_fci.limits import PERIOD_S
from pretouch_fci.motion import Setpoint
from pretouch_fci.state import StateDatagram
from pretouch_fci.wire import PORT, PROTOCOLS

_LATE_S = 0.003
"""Delay from which the robot's time stands [s]: a client could not answer a burst of states in time."""
_DATAGRAMS_MOST = 256
"""So many datagrams are looked at in one go: a flood must not stop the clock."""
_FIRST_WAITS_S = (0.25, 0.75)
"""In lockstep, how long the first state of a motion, and each that follows, stands without an answer [s]: the vendor's
clients answer the second one, and give up after a second without a state."""
_ANSWERED = 6
"""Number of first states of a motion of which libfranka answers one: it has waited for those before."""
_MOTION_EVERY = 1_000_000
"""In lockstep, each motion begins at a multiple of this [ms], so that its times do not depend on the time before it."""


@dataclass(frozen=True)
class FciOptions(Checked):
    """Address and pace of the server."""

    host: str = "127.0.0.1"
    """Address to serve at. Anyone who can reach it can move the simulated arm."""
    port: Annotated[int, Check(low=0, high=0xFFFF)] = PORT
    """TCP port; the vendor's library supports no other. The gripper has the next. 0 lets the system choose both."""
    lockstep: bool = False
    """Send each state only after the command for the last one: repeatable, and faster than real time."""
    patience: Positive = 60.0
    """Time after which a command that has not arrived in lockstep is lost [s]."""
    grace: NonNegative = 0.01
    """In real time, extra time beyond its millisecond to wait for a command [s]: this machine may be slow. 0 is as
    strict as the robot."""
    drop: str = ""
    """Commands to lose, such as 3/50: the first 3 of every 50."""
    once: bool = False
    """End when the first client has disconnected."""


def drop_of(text: str) -> tuple[int, int]:
    """Read N/M: of how many commands the first are lost; none is."""
    lost, slash, of = (text or "0/1").partition("/")
    if text and not (slash and lost.isdecimal() and of.isdecimal() and 0 < int(lost) < int(of)):
        raise ParameterError(f"--drop is {text!r}: give two numbers, such as 3/50 for 3 of 50 commands.")
    return int(lost), int(of)


class FciServer(ClientPort):
    """Serves one arm. A context manager, for the sockets."""

    def __init__(
        self, arm: ServedArm, options: FciOptions,
        watch: Callable[[float, ServedArm], None] = lambda _time, _arm: None, say: Callable[[str], None] = print,
    ) -> None:  # fmt: skip
        """Listen; an address that cannot be had is a RobotError.

        Args:
            arm: to serve.
            options: where, and at which pace.
            watch: is called with the robot's time [s] and the arm after each millisecond of the plant.
            say: is handed a line when a client comes or goes, and when a motion ends otherwise than it should.
        """
        self._arm, self._options, self._watch = arm, options, watch
        self._drop = drop_of(options.drop)
        self.protocol = PROTOCOLS[arm.kind]
        urdf_of(arm.model)  # made while no clock runs yet
        super().__init__(options.host, options.port, self.protocol, say)
        host, port = self.address
        try:
            self._gripper = GripperServer((host, options.port and port + 1), arm, options.lockstep, say)
        except RobotError:
            super().close()
            raise
        self.gripper_address = self._gripper.address
        """Address of the hand: the next port."""
        self._state = StateDatagram(self.protocol, arm)
        self._handler: RequestHandler | None = None
        self._served = False
        self._done: Callable[[], bool] = lambda: False
        self._tick = 0
        self._motions = self._unanswered = self._of_motion = self._answered_until = 0
        self._command: np.void | None = None
        self._next = self._start = 0.0
        self.left_out = 0.0
        """Time that the machine was too slow to simulate [s]."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect the clients and stop listening."""
        super().close()
        self._gripper.close()

    def serve(self, done: Callable[[], bool] = lambda: False) -> None:
        """Serve until `done` says so, or, if asked to serve once, until the client has disconnected."""
        self._start = self._next = time.monotonic()
        self._done = done
        while not done() and not (self._options.once and self._served and self._client is None):
            self._settle()
            if self._client is not None:
                self._send(self._state.write(self._tick))
            self._wait()
            self._pass_time(self._setpoint())

    # a millisecond

    def _wait(self) -> None:
        """Wait for the next millisecond, or in lockstep for the command."""
        arm, now = self._arm, time.monotonic()
        self._command = None
        if not self._options.lockstep:
            self._next += PERIOD_S
            if now - self._next > _LATE_S:
                self.left_out += now - self._next
                self._next = now
            self._poll_sockets(self._next)
            if self._command is None and self._command_due:
                self._poll_sockets(self._next + self._options.grace, for_command=True)
        elif arm.motion is None or not arm.motion.awaited:
            self._poll_sockets(now + PERIOD_S)
        elif arm.motion.begun:
            self._poll_sockets(now + self._options.patience, for_command=True)
        else:
            self._poll_sockets(now + _FIRST_WAITS_S[min(self._unanswered, 1)], for_command=True)

    @property
    def _command_due(self) -> bool:
        """Return True if a client that keeps up answers this state: libfranka's filter needs the first command."""
        motion = self._arm.motion
        return motion is not None and motion.awaited and (motion.begun or self._tick < self._answered_until)

    def _pass_time(self, setpoint: Setpoint | None) -> None:
        """Let the plant move on, unless in lockstep it stands."""
        arm, lockstep = self._arm, self._options.lockstep
        begins = arm.motion is not None and not arm.motion.begun
        if lockstep and setpoint is None and (begins or arm.settled):
            self._unanswered += begins
            self._tick += 1
            return
        if arm.units is not None:
            arm.units.offset = PERIOD_S * self._tick + self.left_out - arm.plant.time
        ending = arm.step(setpoint)
        self._tick += 1
        handler = self._handler
        if ending is not None and handler is not None:
            self._attempt(lambda: handler.motion_ended(ending))
        self._watch(PERIOD_S * self._tick, arm)
        if arm.units is not None:
            arm.units.step(lambda: PERIOD_S * self._tick if lockstep else time.monotonic() - self._start)
        if self._handler is not None and arm.at_rest:
            self._attempt(self._handler.at_rest)

    # commands

    def _setpoint(self) -> Setpoint | None:
        """Return what the command says that came for this millisecond, None if it was lost."""
        command, motion = self._command, self._arm.motion
        if motion is None:
            return None
        losses, of = self._drop
        lost = command is None or (motion.begun and self._of_motion % of < losses)
        self._of_motion += motion.begun or not lost
        if command is None or lost:
            return None
        names = command.dtype.names or ()
        finished = any(command[name] for name in names if name.endswith("_finished"))
        return Setpoint(motion.kind.read(command), bool(finished), command["tau_J_d"].copy())

    def _take_command(self) -> None:
        """Take in what came by UDP, and keep the newest command that is one for this millisecond."""
        for _ in range(_DATAGRAMS_MOST):
            try:
                data, sender = self._udp.recvfrom(2048)
            except BlockingIOError:
                return
            except OSError:  # news of a state that found nobody
                continue
            motion = self._arm.motion
            if motion is None or sender != self._client_udp or len(data) != self.protocol.command.itemsize:
                continue
            command = np.frombuffer(data, self.protocol.command)[0]
            if int(command["message_id"]) == self._tick or not motion.awaited:
                self._command = command

    # clients

    def _poll_sockets(self, until: float, for_command: bool = False) -> None:
        """Poll all sockets until an instant [s], or until a command has come."""
        while True:
            timeout = max(0.0, min(until, self._gripper.due) - time.monotonic())
            ready, _, _ = select.select([self._udp, *self.sockets, *self._gripper.sockets], [], [], timeout)
            self._gripper.serve(ready)
            if self._udp in ready:
                self._take_command()
            self._serve_ready(ready)
            if for_command and (self._command is not None or self._arm.motion is None):
                return
            if time.monotonic() >= until:
                return

    def _came(self, client: Connection) -> None:
        self._served = True
        self._handler = RequestHandler(
            client, self.protocol, self._arm, self._state, self._settle, self._begin_motion, self._say
        )

    def _follow(self, requests: list[Request]) -> None:
        if self._handler is not None:
            self._handler.serve(requests)

    def _gone(self) -> None:
        self._handler = None
        if self._arm.moving:
            self._arm.stop()
        self._arm.forget_settings()
        self._state.frames_changed()

    def _begin_motion(self) -> None:
        """Note that a motion is about to begin."""
        self._motions += 1
        self._unanswered = self._of_motion = 0
        self._answered_until = self._tick + _ANSWERED
        if self._options.lockstep:
            start = max(self._motions, self._tick // _MOTION_EVERY + 1) * _MOTION_EVERY
            self._tick = start - 1

    def _settle(self) -> None:
        """Let the arm come to rest between two states in lockstep: a client sees a difference in time alone."""
        while self._options.lockstep and not self._arm.moving and not self._arm.settled and not self._done():
            self._pass_time(None)
