"""The process that speaks with the arm: each millisecond a state from it, and a command to it.

It does nothing else, so that nothing keeps it from answering in time. Set-points come through shared memory, and the
arm comes to rest, within its limits, when they are older than `FrankaParams.stale_after_s`, when one is no number or
beyond the limits, when the program that sent them has died, and on SIGTERM. What a terminal sends, as Ctrl-C, is left
to the program.

After stale set-points a fresh one is followed again: a controller goes on from where the arm says it is, at rest. After
`FrankaParams.end_after_s` without one, and after one that was refused, the motion ends, and nothing is followed until
another one is begun.
"""

import os
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from types import FrameType

import numpy as np

from pretouch.arms.franka.connection import FrankaClient, Kind
from pretouch.arms.franka.exchange import ArmCommand, ArmRequest, Communication, Feedback, Mailboxes
from pretouch.arms.franka.limiter import SetPointLimiter, refusal
from pretouch.arms.franka.limits import CollisionBehavior, FrankaLimits, FrankaParams
from pretouch.arms.franka.state import JOINTS, FrankaState
from pretouch.errors import PretouchError, RobotError
from pretouch.realtime import real_time
from pretouch.signals import leave_to_parent
from pretouch.types import FloatArray

_TERMINATED = "The process that moves the arm was told to end, so the arm was brought to rest: reconnect."
_REST = [0.0] * JOINTS
_ARRIVED_RAD_S = 1e-4
"""Velocity that the arm may still report when its motion is ended."""


@dataclass(frozen=True)
class ProcessSettings:
    """Settings of the process that talks to the arm."""

    address: str
    kind: Kind
    limits: FrankaLimits
    behavior: CollisionBehavior | None
    params: FrankaParams
    priority: int | None
    parent: int
    """Number of the process that sends the commands."""


class VelocityMotion:
    """Follows the set-points of one request, comes to rest without them, and ends at rest."""

    def __init__(
        self,
        number: int,
        settings: ProcessSettings,
        mailboxes: Mailboxes,
        communication: Communication,
        is_over: Callable[[], bool],
    ) -> None:
        """Take the request's number, the mailboxes, and a further condition that ends the motion."""
        self._number, self._mailboxes = number, mailboxes
        self._limits, self._params = settings.limits, settings.params
        self._communication, self._is_over = communication, is_over
        self._limiter = SetPointLimiter(settings.limits, settings.params.limiter)
        self._command: ArmCommand | None = None
        self._ending = self._stale = False
        self.trouble = ""
        """Reason of an end of the motion that nobody requested."""
        communication.in_motion = 0

    def answer(self, state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        """Return joint velocities (7,) [rad/s] and whether the motion is finished, `since` [s] after the last state."""
        now = time.monotonic()
        command = self._mailboxes.commands.read()
        velocity = self._limiter.step(state, self._target(command, now))
        finished = self._ending and self._limiter.at_rest and max(map(abs, state.dq_d.tolist())) < _ARRIVED_RAD_S
        self._mailboxes.feedback.put(Feedback(now, self._number, True, self.trouble, state))
        self._communication.reseeds += self._limiter.lost
        self._communication.answered(since, state.success_rate, time.monotonic() - now)
        return np.array(velocity), finished

    def _target(self, command: ArmCommand, now: float) -> list[float]:
        """Return the velocities to go to: the set-point, or rest."""
        requested = command.request is ArmRequest.MOVE and command.number == self._number
        self._ending = self._ending or not requested or self._is_over()
        if not self._ending:
            self.trouble = self._objection(command, now)
            self._ending = bool(self.trouble)
        if self._ending:
            return _REST
        was, self._stale = self._stale, now - command.stamp > self._params.stale_after_s
        if self._stale and not was and not self._limiter.at_rest:
            self._communication.stale += 1
        return _REST if self._stale else command.qd

    def _objection(self, command: ArmCommand, now: float) -> str:
        """Return the fault of a command that ends the motion, or ''."""
        wrong = ""
        if command is not self._command:
            self._command, wrong = command, refusal(command.qd, self._limits)
        most = self._params.end_after_s
        if now - command.stamp > most:
            return (
                f"The arm was brought to rest and its motion ended, because no set-point came for {most:g} s: check the"
                " program that commands it, then begin again."
            )
        return f"The arm was brought to rest, because {wrong}: check the program that commands it." if wrong else ""


def serve(settings: ProcessSettings, mailboxes: Mailboxes, started: Connection) -> None:
    """Carry out commands until a request to quit or the end of the program; send it '', or a sentence on a failure."""
    leave_to_parent()
    with ExitStack() as opened:
        try:
            client = opened.enter_context(FrankaClient(settings.address, settings.kind))
            if settings.behavior is not None:
                client.set_collision_behavior(settings.behavior)
            server = ArmServer(client, settings, mailboxes)
        except PretouchError as error:
            started.send((False, str(error)))
            return
        missing = opened.enter_context(real_time(settings.priority))
        started.send((True, " ".join(missing)))
        started.close()
        server.serve()


class ArmServer:
    """Carries out commands through the client, one after the other."""

    def __init__(self, client: FrankaClient, settings: ProcessSettings, mailboxes: Mailboxes) -> None:
        self._client, self._settings, self._mailboxes = client, settings, mailboxes
        self._communication = Communication()
        self._answered, self._trouble = 0, ""
        self._leaving = False
        self._state, self._stamp = client.read(), time.monotonic()
        self._send_feedback()
        signal.signal(signal.SIGTERM, self._leave)
        signal.siginterrupt(signal.SIGTERM, False)

    def serve(self) -> None:
        """Carry out commands until it is time to quit."""
        while not self._is_over():
            command = self._mailboxes.commands.read()
            if command.request is ArmRequest.QUIT:
                break
            if command.number > self._answered:
                self._execute(command)
                self._mailboxes.report.put(self._communication)
            try:
                self._state, self._stamp = self._client.read(), time.monotonic()
            except RobotError as error:
                self._trouble = self._trouble or str(error)
                break
            self._send_feedback()
        if self._leaving:
            self._trouble = self._trouble or _TERMINATED
        self._send_feedback()

    def _send_feedback(self) -> None:
        """Send the present state while no motion runs."""
        trouble = self._trouble[:2000]  # what a library says may be of any length
        self._mailboxes.feedback.put(Feedback(self._stamp, self._answered, False, trouble, self._state))

    def _execute(self, command: ArmCommand) -> None:
        self._trouble = ""
        try:
            if command.request is ArmRequest.MOVE:
                settings = self._settings
                motion = VelocityMotion(command.number, settings, self._mailboxes, self._communication, self._is_over)
                self._client.control(motion.answer)
                self._trouble = motion.trouble
            elif command.request is ArmRequest.RECOVER:
                self._client.recover()
        except RobotError as error:
            self._trouble = str(error)
        feedback = self._mailboxes.feedback.read()
        if feedback is not None:  # the motion's last state: there may be no other
            self._state, self._stamp = feedback.state, feedback.stamp
        # requests during a motion have ended it, and must not be carried out later
        self._answered = (
            self._mailboxes.commands.read().number if command.request is ArmRequest.MOVE else command.number
        )

    def _is_over(self) -> bool:
        """Return True if nobody is left to serve."""
        return self._leaving or os.getppid() != self._settings.parent

    def _leave(self, _number: int, _frame: FrameType | None) -> None:
        self._leaving = True
