"""What somebody at a page asks of the arm's hand, by a target or by keys: no page, no thread, no clock."""

import re

import numpy as np

from pretouch import desired
from pretouch.desired import Desired
from pretouch.errors import ParameterError
from pretouch.types import FloatArray

REACH_M = 1.2
"""Largest coordinate of a target [m]."""
KEYS_S = 0.3
"""How long keys and sticks count after the page last said so [s]: it says so ten times a second while they are held."""
_KEYS = re.compile(r"(-?\d{1,3}) (-?\d{1,3}) (-?\d{1,3}) \d{1,2}")
"""Per cent of the speed ahead, left and up, and a number that tells one message from the next."""


class Steering:
    """A commander that asks for a pose, or for a velocity, until it is asked for something else."""

    def __init__(self) -> None:
        self.held = False
        """Whether who steers is there and commands: else what is asked ages, and the arm comes to rest."""
        self._stamp = 0.0
        self.stand()

    def stand(self) -> None:
        """Ask for no motion."""
        self.goal: FloatArray | None = None
        """(4, 4) T_O_ee to go to; None: a velocity is asked for."""
        self._velocity, self._since = np.zeros(3), 0.0

    def target(self, position: FloatArray, rotation: FloatArray) -> None:
        """Ask for a position (3,) [m], or the nearest in the workspace, and an orientation (3, 3), base frame."""
        self.goal = np.eye(4)
        self.goal[:3, :3], self.goal[:3, 3] = rotation, np.clip(position, -REACH_M, REACH_M)

    def push(self, velocity: FloatArray, now: float) -> None:
        """Ask for a velocity of the end-effector (3,) [m/s], base frame, for `KEYS_S` from an instant [s] on."""
        self.goal, self._velocity, self._since = None, velocity, now

    def __call__(self, now: float) -> Desired:
        """Return what is asked at an instant [s]."""
        self._stamp = now if self.held else min(self._stamp, now)
        if self.goal is not None:
            return desired.pose(self._stamp, self.goal)
        return desired.twist(self._stamp, self._velocity if 0.0 <= now - self._since <= KEYS_S else np.zeros(3))


def velocity_of(keys: str, look: FloatArray, speed: float) -> FloatArray:
    """Velocity (3,) [m/s], base frame, of what a page says of its keys, see `_KEYS`; anything else is a ParameterError.

    Args:
        keys: as the page says them.
        look: (3,) where the person looks: ahead is along it, on the level.
        speed: at a hundred per cent, and in all directions together at most [m/s].
    """
    found = _KEYS.fullmatch(keys)
    if found is None:
        raise ParameterError(f"The keys say {keys!r}: give per cent ahead, left and up, and a number, as 100 0 0 1.")
    ahead, left, up = np.array([int(share) for share in found.groups()]) / 100.0
    heading = float(np.arctan2(look[1], look[0]))
    c, s = np.cos(heading), np.sin(heading)
    way = np.array([c * ahead - s * left, s * ahead + c * left, up])
    return np.asarray(speed * way / max(1.0, float(np.linalg.norm(way))))
