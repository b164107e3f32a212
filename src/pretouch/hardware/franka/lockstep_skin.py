"""The units of an arm in lockstep: their datagrams are taken in at each of the arm's states, by its time."""

from typing import Self

import numpy as np

from pretouch.hardware.keys import Keys
from pretouch.hardware.receiver import SkinReceiver
from pretouch.sensing.skin import Skin
from pretouch.types import RangeReadings, TouchReadings


class LockstepSkin:
    """Gives the readings there are at a robot time, as `run_in_lockstep` asks for them; a context manager.

    For one motion: the time of the next one is not that of the last.
    """

    def __init__(self, skin: Skin, keys: Keys, host: str, port: int, seed: int = 0) -> None:
        """Listen for the skin's units; what the receiver draws comes from the seed, so that runs repeat."""
        self._now = 0.0
        draw = np.random.default_rng([seed, 8]).bytes
        self.receiver = SkinReceiver(skin.ids, keys, host, port, clock=lambda: self._now, draw=draw)

    def __call__(self, time: float) -> RangeReadings:
        """Take in what has come by a robot time [s]; return the newest reading of each unit."""
        self._now = time
        self.receiver.receive()
        return self.receiver.readings()

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit, as of the last time asked for."""
        return self.receiver.touch()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.receiver.close()
