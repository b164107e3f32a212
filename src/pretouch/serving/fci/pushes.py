"""Forces of known size on the end-effector: what a client's estimate can be compared with."""

import math
from dataclasses import dataclass

import numpy as np

from pretouch.errors import ParameterError
from pretouch.sim.plant import Plant
from pretouch.types import FloatArray

_LASTING_S = 0.5
"""How long a push lasts unless it says so [s]."""
_NONE = np.zeros(3)


@dataclass(frozen=True, slots=True)
class TcpPush:
    """A force at the end-effector's origin for a while."""

    start: float
    """[s]"""
    force: tuple[float, float, float]
    """On the arm, base frame [N]."""
    duration: float = _LASTING_S
    """[s]"""


def push_of(text: str) -> TcpPush:
    """Read a push from T:FX,FY,FZ or T:FX,FY,FZ:DURATION."""
    parts = text.split(":")
    try:
        start, duration = float(parts[0]), float(parts[2]) if len(parts) == 3 else _LASTING_S
        x, y, z = map(float, parts[1].split(","))
    except (ValueError, IndexError):
        start = duration = x = y = z = math.nan
    if len(parts) > 3 or not all(map(math.isfinite, (start, duration, x, y, z))) or start < 0 or duration <= 0:
        raise ParameterError(
            f"The push is {text!r}: give start, force and, if you like, duration, as 2.0:0,15,0:0.5 [s, N, s]."
        )
    return TcpPush(start, (x, y, z), duration)


class Pushes:
    """Pushes an arm at the end-effector, at the times of a clock that begins with the plant's at `begin`."""

    def __init__(self, plant: Plant, pushes: tuple[TcpPush, ...], begin: float) -> None:
        self._plant, self._pushes, self._begin, self._link = plant, pushes, begin, plant.model.ee
        self.force: FloatArray = _NONE
        """(3,) the force now [N]."""
        if pushes:
            plant.before_each_step(self._push)

    def _push(self, time: float) -> None:
        now, data, link = time - self._begin, self._plant.mj_data, self._link
        self.force = sum(
            (np.array(p.force) for p in self._pushes if p.start <= now < p.start + p.duration), start=_NONE
        )
        data.xfrc_applied[link, :3] = self.force
        # the simulation applies it at the centre of mass
        data.xfrc_applied[link, 3:] = np.cross(data.xpos[link] - data.xipos[link], self.force)
