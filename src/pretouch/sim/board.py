"""The board of the paper's static experiment: what the arm's hand runs into beside it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch.control.path import Path
from pretouch.errors import PathError
from pretouch.sim.scene import Box

Side = Literal["-y", "+y"]

FACE_M = 0.25
"""Distance of the board's face from the plane y = 0 [m]."""
_HALF_SIZE_M = (0.15, 0.02, 0.12)
"""Half the size of the board [m]."""
_OUTWARDS_M = 0.12
"""Its centre is this much farther from the base in x than the hand that meets it [m]."""


@dataclass(frozen=True)
class HandSide:
    """Where the side of the robot's hand that meets the board is, hand as in the ready posture."""

    aside: float = 0.102
    """How far it is out from the end-effector's origin, along y [m]; the Panda's."""
    above: float = 0.057
    """How far it is above the end-effector's origin [m]; the Panda's."""


PANDA_SIDE = HandSide()


def sign_of(side: Side) -> float:
    """Sign of y on a side."""
    return 1.0 if side == "+y" else -1.0


def board_beside(
    path: Path, side: Side, stiffness: float, face: float = FACE_M, aside: float = 0.0, above: float = 0.0,
    hand: HandSide = PANDA_SIDE,
) -> Box:  # fmt: skip
    """Return a board, 0.3 m by 0.24 m, where the robot's hand on a path first meets its plane.

    It does not reach inwards to where the forearm, which is wider than the hand, would meet it first.

    Args:
        path: of the end-effector; one that never comes near the board's plane is a PathError.
        side: on which side of the base the board stands.
        stiffness: of the board [N/m].
        face: distance of its face from the plane y = 0 [m].
        aside: by how much it is moved along x [m].
        above: by how much it is moved along z [m].
        hand: where the side of the hand is that meets it.
    """
    sign = sign_of(side)
    ahead = map(path.point, np.linspace(0.0, path.length, 2000))
    meeting = next((p for p in ahead if sign * p[1] >= face - hand.aside), None)
    if meeting is None:
        raise PathError(f"The path never comes to the board at y = {sign * face:g} m: choose another path or side.")
    center = (
        meeting[0] + _OUTWARDS_M + aside,
        sign * (face + _HALF_SIZE_M[1]),
        meeting[2] + hand.above + above,
    )
    return Box("object", center, _HALF_SIZE_M, stiffness)
