"""A Franka arm in real time: the port `Arm`, through a process that talks to the arm each millisecond."""

import os
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Self

from pretouch.arms.franka.connection import Kind, attempt, check_ready
from pretouch.arms.franka.exchange import ArmCommand, ArmRequest, Communication, Feedback, Mailboxes
from pretouch.arms.franka.limits import CollisionBehavior, FrankaParams, motion_limits
from pretouch.arms.franka.process import ProcessSettings, serve
from pretouch.arms.franka.state import JOINTS, FrankaState, TorqueWatch, robot_state
from pretouch.errors import RobotError
from pretouch.realtime import check_wishes
from pretouch.robot.model import RobotModel
from pretouch.signals import kept_from_children
from pretouch.types import FloatArray, RobotState

_START_S = 30.0
"""Longest time for the process to start, and for the arm to answer it [s]."""
_ANSWER_S = 10.0
"""Longest time for a request [s]: a recovery takes seconds."""
_STATE_MOST_S = 0.5
"""Age at which a state says nothing about the arm any more [s]."""
_LOOK_S = 0.001
_NAMES: dict[Kind, str] = {"panda": "Panda", "fr3": "FR3"}


class FrankaArm:
    """A connected arm that reports its states; a context manager.

    `begin`, commands, `end`: in between the arm follows the newest command, which must not be older than
    `FrankaParams.stale_after_s`. However the program ends, the arm comes to rest (`process`). For one thread.
    """

    def __init__(
        self,
        address: str,
        kind: Kind,
        model: RobotModel,
        params: FrankaParams | None = None,
        behavior: CollisionBehavior | None = None,
        priority: int | None = None,
    ) -> None:
        """Start the process of the arm at a name or IP address, and connect; a failure is a RobotError.

        `behavior` has the forces from which the arm stops by itself, None leaves them as they are; `priority` is the
        real-time priority of the process, see `realtime.real_time`.
        """
        check_wishes(priority, None)
        self._address, self._owner = address, os.getpid()
        self.name = f"{_NAMES[kind]} at {address}"
        self._mailboxes, self._number, self._torques = Mailboxes(), 0, TorqueWatch()
        limits = motion_limits(model, kind)
        settings = ProcessSettings(address, kind, limits, behavior, params or FrankaParams(), priority, self._owner)
        context = get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=serve, args=(settings, self._mailboxes, theirs), daemon=True)
        with kept_from_children():
            self._process.start()
        theirs.close()
        try:
            with ours:
                self.missing = _wait_connected(ours, address, kind)
                """Sentences on settings that the process was refused, or ''."""
        except BaseException:
            self._process.kill()  # no motion runs yet, and it may hang in the vendor's library
            self._process.join()
            raise

    @property
    def pid(self) -> int:
        """Number of the process, to give it a processor."""
        return self._process.pid or 0

    def state(self) -> FrankaState:
        """Return the newest state, in the vendor's terms and signs; a RobotError if none has come for a while."""
        return self._fresh_feedback().state

    def read(self) -> RobotState:
        """Return the newest state, stamped with `time.monotonic` as it came; a RobotError as of `state`."""
        feedback = self._fresh_feedback()
        return self._torques.believed(robot_state(feedback.state, feedback.stamp))

    def begin(self) -> None:
        """Begin a motion at rest. Commands must follow within `FrankaParams.end_after_s`."""
        self._make_request(ArmRequest.MOVE)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (7,) [rad/s] as the set-point; a RobotError says why the arm follows none."""
        feedback = self._feedback()
        if feedback.trouble:
            raise RobotError(feedback.trouble)
        self._demand_fresh(feedback)
        if not feedback.moving:
            raise RobotError(f"The arm at {self._address} is not in a motion: begin one first.")
        self._send(ArmRequest.MOVE, [float(v) for v in qd])

    def end(self) -> None:
        """Bring the arm to rest and end the motion; a RobotError says what had ended it before."""
        if self._feedback().moving:
            self._send(ArmRequest.END, [0.0] * JOINTS)
            self._wait(self._at_rest, "come to rest")
        trouble = self._feedback().trouble
        if trouble:
            raise RobotError(trouble)

    def recover(self) -> None:
        """Let the arm leave the mode "reflex"."""
        self._make_request(ArmRequest.RECOVER)

    def unfit(self) -> tuple[str, ...]:
        """Return the reason why the arm cannot be moved in its mode."""
        state = self.state()
        try:
            check_ready(state, self._address)
        except RobotError as error:
            return (str(error), "Run with --recover.") if state.mode == "reflex" else (str(error),)
        return ()

    @property
    def communication(self) -> Communication:
        """Timing of the process in the motions that have ended."""
        return self._mailboxes.report.read()

    def report(self) -> str:
        """Return the timing as lines; '' if no motion has ended."""
        return str(self.communication) if self.communication.cycles else ""

    def close(self) -> None:
        """Bring the arm to rest and end the process; end it at once where no state comes.

        In a process forked from the one that began it, do nothing.
        """
        if os.getpid() != self._owner:
            return
        self._number += 1
        self._send(ArmRequest.QUIT, [0.0] * JOINTS)
        until = time.monotonic() + _ANSWER_S
        while self._process.is_alive() and time.monotonic() < min(until, self._feedback().stamp + _STATE_MOST_S):
            self._process.join(_LOOK_S)
        self._process.kill()
        self._process.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _make_request(self, request: ArmRequest) -> None:
        """Make a request and wait until it is answered; raise a RobotError with what went wrong."""
        if self._fresh_feedback().moving:
            raise RobotError(f"The arm at {self._address} is in a motion: end it first.")
        self._number += 1
        self._send(request, [0.0] * JOINTS)
        try:
            self._wait(lambda feedback: feedback.answered >= self._number, request.name.lower())
        except BaseException:
            self._send(ArmRequest.WAIT, [0.0] * JOINTS)  # it is not to happen later
            raise
        trouble = self._feedback().trouble
        if trouble:
            raise RobotError(trouble)

    def _send(self, request: ArmRequest, qd: list[float]) -> None:
        self._mailboxes.commands.put(ArmCommand(self._number, request, time.monotonic(), qd))

    def _wait(self, answered: Callable[[Feedback], bool], what: str) -> None:
        until = time.monotonic() + _ANSWER_S
        while not answered(self._feedback()):
            self._demand_process()
            if time.monotonic() > until:
                raise RobotError(f"The arm at {self._address} did not {what} within {_ANSWER_S:g} s: stop it by hand.")
            time.sleep(_LOOK_S)

    def _at_rest(self, feedback: Feedback) -> bool:
        """Return True if a motion has ended; a RobotError where no state tells."""
        if feedback.moving:
            self._demand_fresh(feedback)
        return not feedback.moving

    def _fresh_feedback(self) -> Feedback:
        feedback = self._feedback()
        self._demand_fresh(feedback)
        return feedback

    def _demand_fresh(self, feedback: Feedback) -> None:
        self._demand_process()
        age = time.monotonic() - feedback.stamp
        if age > _STATE_MOST_S:
            raise RobotError(
                f"No state has come from the arm at {self._address} for {age:.1f} s; without commands it stops by"
                " itself: look at the arm, its network cable, and what else keeps this machine busy."
            )

    def _feedback(self) -> Feedback:
        feedback = self._mailboxes.feedback.read()
        if feedback is None:
            raise RobotError(f"No state has come from the arm at {self._address}: check its network cable.")
        return feedback

    def _demand_process(self) -> None:
        if not self._process.is_alive():
            raise RobotError(
                self._feedback().trouble
                or f"The process that moves the arm at {self._address} has ended, and the arm stops by itself: check"
                " that it stands still, then reconnect."
            )


def _wait_connected(started: Connection, address: str, kind: Kind) -> str:
    """Wait for the process to be connected; return what it could not have."""
    began = time.monotonic()
    if not started.poll(_START_S):
        raise RobotError(
            f"The host at {address} accepts connections, but does not answer as an arm ({attempt(kind, began)}): check"
            " the address, and restart the control box if it is an arm's."
        )
    try:
        connected, text = started.recv()
    except EOFError:
        raise RobotError(
            "The process for the arm ended before it was connected: see what it printed (a script must start it under"
            ' `if __name__ == "__main__":`).'
        ) from None
    if not connected:
        raise RobotError(text)
    return str(text)
