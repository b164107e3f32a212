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

from pretouch.errors import PretouchError, RobotError
from pretouch.hardware.franka.client import Client, Kind, connect
from pretouch.hardware.franka.collision import CollisionBehavior
from pretouch.hardware.franka.limits import MotionLimits
from pretouch.hardware.franka.motion import Motion
from pretouch.hardware.franka.orders import Boxes, Order, Told, Wish
from pretouch.hardware.franka.params import FrankaParams
from pretouch.hardware.franka.report import Communication
from pretouch.realtime import real_time
from pretouch.signals import OF_TERMINAL, leave_to_parent

_TOLD_TO_END = "The process that moves the arm was told to end, so the arm was brought to rest: connect anew."


@dataclass(frozen=True)
class Task:
    """What the process is to do."""

    address: str
    kind: Kind
    limits: MotionLimits
    behavior: CollisionBehavior | None
    params: FrankaParams
    priority: int | None
    parent: int
    """Number of the process that gives the orders."""


def serve(task: Task, boxes: Boxes, started: Connection) -> None:
    """Serve orders until told to quit or the program is gone; tell it '', or as a sentence what is wrong."""
    leave_to_parent(OF_TERMINAL)
    with ExitStack() as opened:
        try:
            client = opened.enter_context(connect(task.address, task.kind, task.params.demand_real_time))
            if task.behavior is not None:
                client.set_collision_behavior(task.behavior)
            server = ArmServer(client, task, boxes)
        except PretouchError as error:
            started.send((False, str(error)))
            return
        missing = opened.enter_context(real_time(task.priority))
        started.send((True, " ".join(missing)))
        started.close()
        server.serve()


class ArmServer:
    """Turns orders into what the client does, one after the other."""

    def __init__(self, client: Client, task: Task, boxes: Boxes) -> None:
        self._client, self._task, self._boxes = client, task, boxes
        self._communication = Communication()
        self._answered, self._trouble = 0, ""
        self._leaving = False
        self._state, self._stamp = client.read(), time.monotonic()
        self._tell()
        signal.signal(signal.SIGTERM, self._leave)
        signal.siginterrupt(signal.SIGTERM, False)

    def serve(self) -> None:
        """Do as the orders say until it is time to quit."""
        while not self._is_over():
            order = self._boxes.ordered()
            if order.wish is Wish.QUIT:
                break
            if order.request > self._answered:
                self._do(order)
                self._boxes.put_report(self._communication.report())
            try:
                self._state, self._stamp = self._client.read(), time.monotonic()
            except RobotError as error:
                self._trouble = self._trouble or str(error)
                break
            self._tell()
        if self._leaving:
            self._trouble = self._trouble or _TOLD_TO_END
        self._tell()

    def _tell(self) -> None:
        """Pass on the state there is while no motion runs."""
        self._boxes.tell(Told(self._stamp, self._answered, False, self._trouble, self._state))

    def _do(self, order: Order) -> None:
        self._trouble = ""
        try:
            if order.wish is Wish.MOVE:
                task = self._task
                motion = Motion(
                    order.request, task.limits, task.params, self._boxes, self._communication, self._is_over
                )
                self._client.control(motion.answer)
                self._trouble = motion.trouble
            elif order.wish is Wish.RECOVER:
                self._client.recover()
        except RobotError as error:
            self._trouble = str(error)
        if (told := self._boxes.told()) is not None:  # the motion's last state: there may be no other
            self._state, self._stamp = told.state, told.stamp
        # what was asked during a motion ended it, and is not to be done at some later time
        self._answered = self._boxes.ordered().request if order.wish is Wish.MOVE else order.request

    def _is_over(self) -> bool:
        """Whether there is nobody left to serve."""
        return self._leaving or os.getppid() != self._task.parent

    def _leave(self, _number: int, _frame: FrameType | None) -> None:
        self._leaving = True
