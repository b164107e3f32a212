"""A Franka arm in real time: the port `Robot`, over a process that speaks with the arm each millisecond."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
from pretouch.types import FloatArray, RobotState

_START_S = 30.0
"""Longest time for the process to start, and for the arm to answer it [s]."""
_ANSWER_S = 10.0
"""Longest time for a request [s]: a recovery takes seconds."""
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
        self._set_point, self._moves = [0.0] * JOINTS, False
        limits = motion_limits(model, kind)
        task = Task(address, kind, limits, behavior, params or FrankaParams(), priority, self._owner)
        context = get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=serve, args=(task, self._boxes, theirs), daemon=True)
        with _without_interrupts():
            self._process.start()
        theirs.close()
        try:
            with ours:
                self.missing = _greeted(ours)
                """Sentences on what the process could not have, or ''."""
        except BaseException:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """Number of the process, to give it a processor."""
        return self._process.pid or 0

    def state(self) -> FrankaState:
        """Return the newest state, in the vendor's terms and signs."""
        return self._told().state

    def read(self) -> RobotState:
        """Return the newest state, stamped with `time.monotonic` as it came."""
        told = self._told()
        return robot_state(told.state, told.stamp)

    def begin(self) -> None:
        """Begin a motion at rest."""
        self._ask(Wish.MOVE)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (7,) [rad/s] as the set-point; a RobotError says why the arm follows none."""
        told = self._told()
        if told.trouble:
            raise RobotError(told.trouble)
        self._demand_process()
        if not told.moving:
            raise RobotError(f"The arm at {self._address} is in no motion: begin one first.")
        self._order(Wish.MOVE, [float(v) for v in qd])

    def end(self) -> None:
        """Bring the arm to rest and end the motion; a RobotError says what had ended it before."""
        if self._told().moving:
            self._order(Wish.END, [0.0] * JOINTS)
            self._wait(lambda told: not told.moving, "come to rest")
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
        """Bring the arm to rest and end the process. In a process forked from the one that began it, do nothing."""
        if os.getpid() != self._owner:
            return
        self._request += 1
        self._order(Wish.QUIT, [0.0] * JOINTS)
        self._process.join(_ANSWER_S)
        self._process.kill()
        self._process.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, wish: Wish) -> None:
        """Make a request and wait until it is answered; raise a RobotError with what went wrong."""
        self._request += 1
        self._order(wish, [0.0] * JOINTS)
        self._wait(lambda told: told.answered >= self._request, f"{wish.name.lower()}")
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

    def _told(self) -> Told:
        told = self._boxes.told()
        if told is None:
            raise RobotError(f"No state has come from the arm at {self._address}: look at its network cable.")
        return told

    def _demand_process(self) -> None:
        if not self._process.is_alive():
            raise RobotError(
                f"The process that moves the arm at {self._address} has ended: the arm has come to rest; connect anew."
            )


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Start a process in here, and Ctrl-C does not reach it from its first instruction on."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _greeted(started: Connection) -> str:
    """Wait for the process to be connected; return what it could not have."""
    if not started.poll(_START_S):
        raise RobotError(f"The arm did not answer within {_START_S:g} s: look at its network cable.")
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
