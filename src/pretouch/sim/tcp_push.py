"""Forces of known size on the end-effector: what an estimate can be compared with."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pretouch.types import FloatArray

if TYPE_CHECKING:  # who only writes pushes down needs no simulation
    from pretouch.sim.plant import Plant

_NONE = np.zeros(3)


@dataclass(frozen=True, slots=True)
class TcpPush:
    """A force at the end-effector's origin for a while."""

    start: float
    """[s]"""
    force: tuple[float, float, float]
    """On the arm, base frame [N]."""
    duration: float
    """[s]"""


AXES = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Directions by their names, base frame."""


class Pushes:
    """Pushes an arm at the end-effector, at the times of a clock that begins with the plant's at `begin`."""

    def __init__(self, plant: "Plant", pushes: tuple[TcpPush, ...], begin: float) -> None:
        self._plant, self._pushes, self._begin, self._link = plant, pushes, begin, plant.model.ee
        self.force: FloatArray = _NONE
        """(3,) the force now [N]."""
        plant.before_each_step(self._push)

    @property
    def now(self) -> float:
        """The time of the pushes [s]."""
        return self._plant.time - self._begin

    @property
    def under_way(self) -> bool:
        """True if a push is due or lasts."""
        return any(push.start + push.duration > self.now for push in self._pushes)

    def add(self, push: TcpPush) -> None:
        """Have another one come; those that are over are forgotten."""
        self._pushes = (*(p for p in self._pushes if p.start + p.duration > self.now), push)

    def at(self, time: float) -> FloatArray:
        """Return the force (3,) [N] at an instant of the plant's clock [s]."""
        now = time - self._begin
        return sum((np.array(p.force) for p in self._pushes if p.start <= now < p.start + p.duration), start=_NONE)

    def _push(self, time: float) -> None:
        if not self._pushes:
            return
        data, link = self._plant.mj_data, self._link
        self.force = self.at(time)
        data.xfrc_applied[link, :3] = self.force
        # the simulation applies it at the centre of mass
        data.xfrc_applied[link, 3:] = np.cross(data.xpos[link] - data.xipos[link], self.force)
