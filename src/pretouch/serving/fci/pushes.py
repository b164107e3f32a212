"""Forces of known size on the end-effector: what a client's estimate can be compared with."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pretouch.errors import ParameterError
from pretouch.types import FloatArray

if TYPE_CHECKING:  # who only writes pushes down needs no simulation
    from pretouch.sim.plant import Plant

_LASTING_S = 0.5
"""How long a push lasts unless it says so [s]."""
_TYPED_N, _TYPED_S = 15.0, 1.5
"""Force [N] and duration [s] of a push of which only the axis is typed: what a guided push asks for."""
_MOST_N = 1000.0
"""Largest push along an axis [N]."""
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


AXES = {
    "+x": (1.0, 0.0, 0.0), "-x": (-1.0, 0.0, 0.0), "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0), "+z": (0.0, 0.0, 1.0), "-z": (0.0, 0.0, -1.0),
}  # fmt: skip
"""Directions by their names, base frame."""


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
            f"The push is {text!r}: give start, force and optionally duration, such as 2.0:0,15,0:0.5 [s, N, s]."
        )
    if max(map(abs, (x, y, z))) > _MOST_N:
        raise ParameterError(f"The push is {text!r}: give at most {_MOST_N:g} N along each axis.")
    return TcpPush(start, (x, y, z), duration)


def typed_push(text: str, now: float) -> TcpPush:
    """Read what is typed now [s]: an axis, as +y or -x, FX,FY,FZ or FX,FY,FZ:DURATION, or a push that comes T from now.

    The latter as of `push_of` [s, N, s].
    """
    plain = text.strip().lower()
    if plain in AXES:
        x, y, z = AXES[plain]
        return TcpPush(now, (_TYPED_N * x, _TYPED_N * y, _TYPED_N * z), _TYPED_S)
    at_once = "," in plain.partition(":")[0]
    try:
        push = push_of(f"0:{plain}" if at_once else plain)
    except ParameterError:
        raise ParameterError(
            f"{plain!r} is not a push: type an axis, such as +y, or a force, such as 0,15,0 [N], of at most {_MOST_N:g}"
            " N."
        ) from None
    return replace(push, start=now + push.start)


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
        """Whether one is due or lasts."""
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
