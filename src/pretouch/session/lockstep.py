"""A simulated Franka arm that waits for each command, and its units, all by the arm's own time.

The units are heard in the thread that answers the arm, once for each of its states: what was sent before a state is
known with it, and a run repeats to the last bit.
"""

from collections.abc import Callable
from typing import Self

import numpy as np

from pretouch.controller import Controller
from pretouch.hardware.franka.client import Client
from pretouch.hardware.franka.limiter import PERIOD_S
from pretouch.hardware.franka.lockstep import run_in_lockstep
from pretouch.hardware.keys import Keys
from pretouch.hardware.receiver import SkinReceiver
from pretouch.loop import Recorder
from pretouch.session.session import NoUnits
from pretouch.types import ControlStep, RangeReadings


class RobotTimeUnits:
    """Units of an arm, heard at the instants of its states."""

    def __init__(self, ids: tuple[str, ...], keys: Keys, host: str, port: int, seed: int) -> None:
        """Listen; nonces are drawn from the seed."""
        self._now = 0.0
        draw = np.random.default_rng([seed, 8]).bytes
        self._receiver = SkinReceiver(ids, keys, host, port, clock=lambda: self._now, draw=draw)
        self.address = self._receiver.address

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._receiver.close()

    def at(self, now: float) -> RangeReadings:
        """Take in what has been sent by an instant of the robot's time [s]; return the newest reading of each unit."""
        self._now = now
        self._receiver.receive()
        return self._receiver.readings()


def follow_in_lockstep(
    client: Client,
    controller: Controller,
    units: RobotTimeUnits | None,
    recorder: Recorder,
    done: Callable[[ControlStep], bool],
) -> None:
    """Let the controller move the arm until `done` says so. Whatever ends it, the arm comes to rest first."""
    nothing = NoUnits().read()
    readings_at = units.at if units else lambda _: nothing
    every = round(controller.limits.period / PERIOD_S)
    run_in_lockstep(client, controller, readings_at, recorder, done, every=every)
