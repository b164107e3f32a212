"""A controller turned by a simulated arm that waits for each command: equal runs give equal steps, to the last bit."""

from collections.abc import Callable
from typing import Self

import numpy as np

from pretouch.controller import Controller, ControllerState
from pretouch.hardware.franka.limiter import PERIOD_S, SetPointLimiter
from pretouch.hardware.franka.limits import LimiterParams, motion_limits
from pretouch.hardware.franka.state import FrankaState, robot_state
from pretouch.hardware.franka.vendor import VendorClient
from pretouch.hardware.keys import Keys
from pretouch.hardware.receiver import SkinReceiver
from pretouch.loop import Cycle, explained
from pretouch.realtime import warm_up
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, Inputs, RangeReadings

ReadingsAt = Callable[[float], RangeReadings]
"""Gives the readings there are at a robot time [s]."""
Record = Callable[[Cycle], None]
"""Keeps one turn."""


class LockstepLoop:
    """Answers each state of a motion with a set-point, and turns the controller once a period of the robot's time.

    All stamps are of the robot's time, from the first state of the motion on: the simulated arm's time jumps before it.
    """

    def __init__(
        self, controller: Controller, kind: str, readings_at: ReadingsAt, record: Record, seconds: float
    ) -> None:
        """Move the arm for so long [s], and then bring it to rest; `record` is called with each turn."""
        self._controller, self._readings_at, self._record = controller, readings_at, record
        self._limiter = SetPointLimiter(motion_limits(controller.model, kind), LimiterParams())
        self._every = round(controller.limits.period / PERIOD_S)
        self._turns = round(seconds / controller.limits.period)
        self._state: ControllerState | None = None
        self._begin, self._number = 0.0, 0
        self._velocity = [0.0] * controller.model.n

    def answer(self, state: FrankaState, _since: float) -> tuple[FloatArray, bool]:
        """Return the set-point (7,) [rad/s] after a state, and whether the motion ends with it."""
        readings = self._readings_at(state.time)
        self._begin = state.time if self._state is None else self._begin
        over = self._number == self._turns
        if not over and round((state.time - self._begin) / PERIOD_S) >= self._number * self._every:
            self._turn(state, readings)
        velocity = np.array(self._limiter.step(state, [0.0] * len(self._velocity) if over else self._velocity))
        return velocity, over and self._limiter.at_rest

    def _turn(self, state: FrankaState, readings: RangeReadings) -> None:
        report = robot_state(state, state.time)
        before = self._controller.init(report) if self._state is None else self._state
        robot = explained(self._controller, before, report, state.time)
        inputs = Inputs(state.time, robot, readings)
        step, self._state = self._controller.step(before, inputs)
        self._record(Cycle(inputs, before, step, self._state))
        self._velocity = step.command.tolist()
        self._number += 1


def run_in_lockstep(
    client: VendorClient, controller: Controller, readings_at: ReadingsAt, record: Record, seconds: float
) -> None:
    """Let a controller move the arm. It is compiled before: the arm waits less than a second for its first command."""
    warm_up(controller, robot_state(client.read(), 0.0))
    client.control(LockstepLoop(controller, client.kind, readings_at, record, seconds).answer)


class LockstepSkin:
    """Gives the readings of a skin's units at a robot time; a context manager. For one motion."""

    def __init__(self, skin: Skin, keys: Keys, port: int) -> None:
        """Listen for the units; what the receiver draws comes from a seed, so that runs repeat."""
        self._now = 0.0
        draw = np.random.default_rng([3, 8]).bytes
        self._receiver = SkinReceiver(skin.network, keys, "127.0.0.1", port, clock=lambda: self._now, draw=draw)

    def __call__(self, time: float) -> RangeReadings:
        """Take in what has come by a robot time [s]; return the newest reading of each unit."""
        self._now = time
        self._receiver.receive()
        return self._receiver.readings()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._receiver.close()
