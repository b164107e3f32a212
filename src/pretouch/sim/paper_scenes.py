"""What the arm meets in the paper's experiments: a board beside its path (IV-A), a person who pushes it (IV-C)."""

from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np

from pretouch.control.path import Circle, Path, segment
from pretouch.errors import PathError
from pretouch.sim.hand import FACES, Push, against
from pretouch.sim.scene import Box, HandSpec, SceneSpec

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


_LINE_END_Y, _LINE_X, _LINE_Z = 0.5, 0.4, 0.5
_CENTER, _RADIUS_M = (0.5, 0.0, 0.25), 0.25
_VISITED_ABOVE_M = 0.05
"""Height of a visiting person's hand above the circle's centre, of the Panda's circle [m]."""
_FACE_SPREAD_M = 0.05
"""The seed moves the board's face by up to this [m]."""
_CENTER_SPREAD_M = 0.02
"""The seed moves the board along x and z by up to this [m]."""
_STARTS_S = (4.0, 13.0, 22.0)
_FORCE_N = (15.0, 30.0)
_LASTING_S = (0.2, 0.5)


@dataclass(frozen=True)
class Placement:
    """Where the paper's paths are for an arm: p = scale * p_paper + (shift_x, 0, shift_z), in the base frame."""

    scale: float = 1.0
    shift_x: float = 0.0
    """[m]"""
    shift_z: float = 0.0
    """[m]"""
    left: HandSide = PANDA_SIDE
    """Where the hand meets a board at +y."""
    right: HandSide = PANDA_SIDE
    """Where the hand meets a board at -y."""
    beside: tuple[float, float] = (0.43, 0.43)
    """How far from the plane y = 0 a person's hand is held beside the circle, at -y and at +y [m]: the Panda's hand,
    whose side comes to 0.35 m, passes it by 3 cm."""
    inside: tuple[float, float] = (0.35, 0.35)
    """The same of a hand half of which is in the way."""

    def point(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return where a point of the paper is for this arm [m]."""
        return self.scale * x + self.shift_x, self.scale * y, self.scale * z + self.shift_z

    def path(self, trajectory: str, sign: float) -> Path:
        """Return the paper's circle or line, begun on the side away from a board on the side `sign` (1: +y)."""
        if trajectory == "circle":
            return Circle(self.point(*_CENTER), _RADIUS_M * self.scale, np.pi if sign > 0 else 0.0)
        return segment(
            self.point(_LINE_X, -_LINE_END_Y * sign, _LINE_Z), self.point(_LINE_X, _LINE_END_Y * sign, _LINE_Z)
        )

    def hand(self, side: Side) -> HandSide:
        """Return where the hand is met on a side."""
        return self.left if side == "+y" else self.right

    def face(self, face: float, side: Side) -> float:
        """Return the distance of a board's face from the plane y = 0 [m] at which it is met where the paper's is."""
        return self.scale * face + (self.hand(side).aside - self.scale * PANDA_SIDE.aside)

    def moved(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return where what stands at a point of the paper's room is for this arm [m].

        Within the circle's width it is scaled with it, beyond it keeps its distance from it.
        """
        if self == _UNMOVED:
            return x, y, z
        inner = min(abs(y), _RADIUS_M)
        aside = float(np.copysign(self.scale * inner + abs(y) - inner, y))
        return self.scale * x + self.shift_x, aside, self.scale * z + self.shift_z

    @property
    def ahead(self) -> float:
        """How much farther from the base than at the paper's paths people keep [m]."""
        return max(0.0, self.point(*_CENTER)[0] - _CENTER[0])

    def visited(self, place: str, sign: float) -> tuple[float, float, float]:
        """Return where a person's hand is held `beside` the circle or `inside` it, on the side `sign` (1: +y) [m]."""
        x, _, z = self.point(*_CENTER)
        aside = (self.beside if place == "beside" else self.inside)[int(sign > 0)]
        above = self.hand("+y" if sign > 0 else "-y").above - PANDA_SIDE.above
        return x, sign * aside, z + above + _VISITED_ABOVE_M

    def paths_sentence(self, arm: str) -> str:
        """Say what was done to the paper's paths."""
        return (
            f"The paper's paths for {arm}: {self.scale:.3g} times as large, moved by {self.shift_x:+.2f} m in x and"
            f" {self.shift_z:+.2f} m in z; the board is met on the same part of them."
        )

    def sentence(self, arm: str) -> str:
        """Say what was done to the paper's paths and places."""
        if self == _UNMOVED:
            return f"{arm} has the paper's own paths and places."
        places = [f"{a:.2f} and {b:.2f} m" for a, b in (self.beside, self.inside)]
        return (
            f"{self.paths_sentence(arm)} A person's hand beside the circle is {places[0]} from the plane y = 0 (at -y"
            f" and at +y), one in the way {places[1]}, where the free arm passes 3 cm from the one and through the"
            " middle of the other."
        )


_UNMOVED = Placement()


def static_path(trajectory: str, side: str, placement: Placement = _UNMOVED) -> Path:
    """Return the paper's path, begun on the side away from the object so that the arm runs into it at speed."""
    return placement.path(trajectory, sign_of(cast(Side, side)))


def static_scene(trajectory: str, side: str, stiffness: float, seed: int, placement: Placement = _UNMOVED) -> SceneSpec:
    """Return a board on one side, at another place with each seed."""
    rng, on = np.random.default_rng([seed, 10]), cast(Side, side)
    face = FACE_M + _FACE_SPREAD_M * rng.uniform(-1, 1)
    aside, above = _CENTER_SPREAD_M * rng.uniform(-1, 1, 2)
    way = static_path(trajectory, side, placement)
    board = board_beside(way, on, stiffness, placement.face(face, on), aside, above, placement.hand(on))
    return SceneSpec(boxes=(board,))


def person_scene(hand: HandSpec, placement: Placement) -> SceneSpec:
    """Return a room with a person's hand, which sets out from beyond the arm's reach."""
    x, y, z = hand.start
    return SceneSpec(hand=replace(hand, start=(x + placement.ahead, y, z)))


def dynamic_pushes(seed: int) -> tuple[Push, ...]:
    """Three pushes against different faces, in an order, direction, size and length the seed decides."""
    rng = np.random.default_rng([seed, 11])
    planned = []
    for start, which in zip(_STARTS_S, rng.permutation(len(FACES)), strict=True):
        inwards = against(FACES[which], rng)
        planned.append(Push(start + rng.uniform(0, 2), inwards, rng.uniform(*_FORCE_N), rng.uniform(*_LASTING_S)))
    return tuple(planned)
