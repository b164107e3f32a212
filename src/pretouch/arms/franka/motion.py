"""One joint velocity motion: what to answer to each state of the arm."""

import time
from collections.abc import Callable

import numpy as np

from pretouch.arms.franka.limiter import SetPointLimiter, refusal
from pretouch.arms.franka.limits import FrankaParams, MotionLimits
from pretouch.arms.franka.mailboxes import Command, Feedback, Mailboxes, Request
from pretouch.arms.franka.report import Communication
from pretouch.arms.franka.state import JOINTS, FrankaState
from pretouch.types import FloatArray

_REST = [0.0] * JOINTS
_ARRIVED_RAD_S = 1e-4
"""Velocity that the arm may still report when its motion is ended."""


class VelocityMotion:
    """Follows the set-points of one request, comes to rest without them, and ends at rest."""

    def __init__(
        self, number: int, limits: MotionLimits, params: FrankaParams, mailboxes: Mailboxes,
        communication: Communication, is_over: Callable[[], bool],
    ) -> None:  # fmt: skip
        """Take the request's number, where commands come from and feedback goes, and what else ends the motion."""
        self._number, self._limits, self._params, self._mailboxes = number, limits, params, mailboxes
        self._communication, self._is_over = communication, is_over
        self._limiter = SetPointLimiter(limits, params.limiter)
        self._command: Command | None = None
        self._ending = self._stale = False
        self.trouble = ""
        """Why the motion was ended, if nobody asked for that."""
        communication.begin()

    def answer(self, state: FrankaState, since: float) -> tuple[FloatArray, bool]:
        """Return joint velocities (7,) [rad/s] and whether the motion is finished, `since` [s] after the last state."""
        now = time.monotonic()
        command = self._mailboxes.newest_command()
        velocity = self._limiter.step(state, self._target(command, now))
        finished = self._ending and self._limiter.at_rest and max(map(abs, state.dq_d.tolist())) < _ARRIVED_RAD_S
        self._mailboxes.send_feedback(Feedback(now, self._number, True, self.trouble, state))
        self._communication.reseeds += self._limiter.lost
        self._communication.answered(since, state.success_rate, time.monotonic() - now)
        return np.array(velocity), finished

    def _target(self, command: Command, now: float) -> list[float]:
        """Return the velocities to go to: the set-point, or rest."""
        requested = command.request is Request.MOVE and command.number == self._number
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

    def _objection(self, command: Command, now: float) -> str:
        """Say what about a command ends the motion, or ''."""
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
