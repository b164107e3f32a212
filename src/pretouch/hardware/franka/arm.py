"""A Franka arm in real time: the port `Robot`, over a process that speaks with the arm each millisecond."""

import os
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Self

from pretouch.errors import RobotError
from pretouch.hardware.franka.client import Kind
from pretouch.hardware.franka.collision import CollisionBehavior
from pretouch.hardware.franka.limits import motion_limits
from pretouch.hardware.franka.orders import Boxes, Order, Told, Wish
from pretouch.hardware.franka.params import FrankaParams
from pretouch.hardware.franka.process import Task, serve
from pretouch.hardware.franka.report import CommunicationReport
from pretouch.hardware.franka.state import JOINTS, FrankaState, robot_state
from pretouch.realtime import check_wishes
from pretouch.robot.model import RobotModel
from pretouch.signals import OF_TERMINAL, kept_from_children
from pretouch.types import FloatArray, RobotState

_START_S = 30.0
"""Longest time for the process to start, and for the arm to answer it [s]."""
_ANSWER_S = 10.0
"""Longest time for a request [s]: a recovery takes seconds."""
_STATE_MOST_S = 0.5
"""Age at which a state says nothing about the arm any more [s]."""
_LOOK_S = 0.001


class FrankaArm:
    """An arm that states flow from as soon as it is connected; a context manager.

    `begin`, commands, `end`: in between the arm follows the newest command, which must not be older than
    `FrankaParams.stale_after_s`. However the program ends, the arm comes to rest (`process`). For one thread.
    """

    def __init__(
        self, address: str, kind: Kind, model: RobotModel, params: FrankaParams | None = None,
        behavior: CollisionBehavior | None = None, priority: int | None = None,
    ) -> None:  # fmt: skip
        """Start the process and connect; what stands in the way is a RobotError.

        Args:
            address: name or IP address of the arm.
            kind: which arm it is.
            model: of the arm, for its limits.
            params: settings of the process.
            behavior: from which forces the arm stops by itself; None leaves that as it is.
            priority: real-time priority of the process, see `realtime.real_time`.
        """
        check_wishes(priority, None)
        self._address, self._owner = address, os.getpid()
        self._boxes, self._request = Boxes(), 0
        limits = motion_limits(model, kind)
        task = Task(address, kind, limits, behavior, params or FrankaParams(), priority, self._owner)
        context = get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=serve, args=(task, self._boxes, theirs), daemon=True)
        with kept_from_children(OF_TERMINAL):
            self._process.start()
        theirs.close()
        try:
            with ours:
                self.missing = _greeted(ours, address)
                """Sentences on what the process could not have, or ''."""
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
        return self._fresh().state

    def read(self) -> RobotState:
        """Return the newest state, stamped with `time.monotonic` as it came; a RobotError as of `state`."""
        told = self._fresh()
        return robot_state(told.state, told.stamp)

    def begin(self) -> None:
        """Begin a motion at rest. Commands must follow within `FrankaParams.end_after_s`."""
        self._ask(Wish.MOVE)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (7,) [rad/s] as the set-point; a RobotError says why the arm follows none."""
        told = self._told()
        if told.trouble:
            raise RobotError(told.trouble)
        self._demand_fresh(told)
        if not told.moving:
            raise RobotError(f"The arm at {self._address} is in no motion: begin one first.")
        self._order(Wish.MOVE, [float(v) for v in qd])

    def end(self) -> None:
        """Bring the arm to rest and end the motion; a RobotError says what had ended it before."""
        if self._told().moving:
            self._order(Wish.END, [0.0] * JOINTS)
            self._wait(self._rested, "come to rest")
        trouble = self._told().trouble
        if trouble:
            raise RobotError(trouble)

    def recover(self) -> None:
        """Let the arm leave the mode "reflex"."""
        self._ask(Wish.RECOVER)

    @property
    def report(self) -> CommunicationReport:
        """How well the process kept up, in the motions that have ended."""
        return self._boxes.report()

    def close(self) -> None:
        """Bring the arm to rest and end the process; at once where no state comes: it hangs, or the line is dead.

        In a process forked from the one that began it, do nothing.
        """
        if os.getpid() != self._owner:
            return
        self._request += 1
        self._order(Wish.QUIT, [0.0] * JOINTS)
        until = time.monotonic() + _ANSWER_S
        while self._process.is_alive() and time.monotonic() < min(until, self._told().stamp + _STATE_MOST_S):
            self._process.join(_LOOK_S)
        self._process.kill()
        self._process.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, wish: Wish) -> None:
        """Make a request and wait until it is answered; raise a RobotError with what went wrong."""
        if self._fresh().moving:
            raise RobotError(f"The arm at {self._address} is in a motion: end it first.")
        self._request += 1
        self._order(wish, [0.0] * JOINTS)
        try:
            self._wait(lambda told: told.answered >= self._request, wish.name.lower())
        except BaseException:
            self._order(Wish.WAIT, [0.0] * JOINTS)  # it is not to happen later
            raise
        trouble = self._told().trouble
        if trouble:
            raise RobotError(trouble)

    def _order(self, wish: Wish, qd: list[float]) -> None:
        self._boxes.order(Order(self._request, wish, time.monotonic(), qd))

    def _wait(self, answered: Callable[[Told], bool], what: str) -> None:
        until = time.monotonic() + _ANSWER_S
        while not answered(self._told()):
            self._demand_process()
            if time.monotonic() > until:
                raise RobotError(f"The arm at {self._address} did not {what} within {_ANSWER_S:g} s: stop it by hand.")
            time.sleep(_LOOK_S)

    def _rested(self, told: Told) -> bool:
        """Whether a motion has ended; a RobotError where no state tells."""
        if told.moving:
            self._demand_fresh(told)
        return not told.moving

    def _fresh(self) -> Told:
        told = self._told()
        self._demand_fresh(told)
        return told

    def _demand_fresh(self, told: Told) -> None:
        self._demand_process()
        age = time.monotonic() - told.stamp
        if age > _STATE_MOST_S:
            raise RobotError(
                f"No state has come from the arm at {self._address} for {age:.1f} s: it stops by itself where it gets"
                " no commands; look at it, at its network cable, and at what else keeps this machine busy."
            )

    def _told(self) -> Told:
        told = self._boxes.told()
        if told is None:
            raise RobotError(f"No state has come from the arm at {self._address}: look at its network cable.")
        return told

    def _demand_process(self) -> None:
        if not self._process.is_alive():
            raise RobotError(
                self._told().trouble
                or f"The process that moves the arm at {self._address} has ended: the arm stops by itself; look whether"
                " it stands, then connect anew."
            )


def _greeted(started: Connection, address: str) -> str:
    """Wait for the process to be connected; return what it could not have."""
    if not started.poll(_START_S):
        raise RobotError(
            f"What is at {address} takes connections, and does not answer as an arm within {_START_S:g} s: check the"
            " address."
        )
    try:
        connected, said = started.recv()
    except EOFError:
        raise RobotError(
            "The process for the arm ended before it was connected: what it printed tells why"
            ' (a script must start it under `if __name__ == "__main__":`).'
        ) from None
    if not connected:
        raise RobotError(said)
    return str(said)
