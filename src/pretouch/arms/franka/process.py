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
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from types import FrameType

from pretouch.arms.franka.client import Kind, connect
from pretouch.arms.franka.collision import CollisionBehavior
from pretouch.arms.franka.limits import FrankaParams, MotionLimits
from pretouch.arms.franka.mailboxes import Command, Feedback, Mailboxes, Request
from pretouch.arms.franka.motion import VelocityMotion
from pretouch.arms.franka.report import Communication
from pretouch.arms.franka.vendor import VendorClient
from pretouch.errors import PretouchError, RobotError
from pretouch.realtime import real_time
from pretouch.signals import OF_TERMINAL, leave_to_parent

_TERMINATED = "The process that moves the arm was told to end, so the arm was brought to rest: reconnect."


@dataclass(frozen=True)
class ProcessSettings:
    """What the process is to do."""

    address: str
    kind: Kind
    limits: MotionLimits
    behavior: CollisionBehavior | None
    params: FrankaParams
    priority: int | None
    parent: int
    """Number of the process that sends the commands."""


def serve(settings: ProcessSettings, mailboxes: Mailboxes, started: Connection) -> None:
    """Carry out commands until told to quit or the program is gone; tell it '', or as a sentence what is wrong."""
    leave_to_parent(OF_TERMINAL)
    with ExitStack() as opened:
        try:
            client = opened.enter_context(connect(settings.address, settings.kind))
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
    """Turns commands into what the client does, one after the other."""

    def __init__(self, client: VendorClient, settings: ProcessSettings, mailboxes: Mailboxes) -> None:
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
            command = self._mailboxes.newest_command()
            if command.request is Request.QUIT:
                break
            if command.number > self._answered:
                self._execute(command)
                self._mailboxes.put_report(self._communication.report())
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
        """Pass on the state there is while no motion runs."""
        self._mailboxes.send_feedback(Feedback(self._stamp, self._answered, False, self._trouble, self._state))

    def _execute(self, command: Command) -> None:
        self._trouble = ""
        try:
            if command.request is Request.MOVE:
                settings = self._settings
                motion = VelocityMotion(
                    command.number,
                    settings.limits,
                    settings.params,
                    self._mailboxes,
                    self._communication,
                    self._is_over,
                )
                self._client.control(motion.answer)
                self._trouble = motion.trouble
            elif command.request is Request.RECOVER:
                self._client.recover()
        except RobotError as error:
            self._trouble = str(error)
        if (
            feedback := self._mailboxes.newest_feedback()
        ) is not None:  # the motion's last state: there may be no other
            self._state, self._stamp = feedback.state, feedback.stamp
        # what was asked during a motion ended it, and is not to be done at some later time
        self._answered = self._mailboxes.newest_command().number if command.request is Request.MOVE else command.number

    def _is_over(self) -> bool:
        """Whether there is nobody left to serve."""
        return self._leaving or os.getppid() != self._settings.parent

    def _leave(self, _number: int, _frame: FrameType | None) -> None:
        self._leaving = True
