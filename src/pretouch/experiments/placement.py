"""The paper's paths and board brought into the reach of another arm than a Panda."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from pretouch.control.path import Circle, Path, line
from pretouch.control.task import rotation_error
from pretouch.errors import ExperimentError
from pretouch.importing.reaching import Pace, reached
from pretouch.importing.ready import ever_apart, reach_of
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.self_distance import capsule_ends, kinematics_of, self_distances
from pretouch.sim.board import PANDA_SIDE, HandSide, Side, sign_of
from pretouch.types import FloatArray

_SIDES: tuple[Side, Side] = ("+y", "-y")
_LINE_END_Y, _LINE_X, _LINE_Z = 0.5, 0.4, 0.5
_SHRINK = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
_SHIFT_M = (0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15, 0.2, -0.2)
"""What is tried, the nearest to the paper first: parts of the scale by reach, shifts along x and z."""
_PLACES = 48
_TO_START, _ONWARD = Pace(300, 0.1, 1e-6, 0.05), Pace(30, 0.1, 1e-6, 0.05)
_SINGULAR, _LIMIT_RAD, _CLEAR_M = 0.05, 0.05, 0.01
"""What the arm has to keep all along: smallest singular value, distance from joint limits, and from itself."""


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

    def point(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return where a point of the paper is for this arm [m]."""
        return self.scale * x + self.shift_x, self.scale * y, self.scale * z + self.shift_z

    def path(self, trajectory: str, sign: float) -> Path:
        """Return the paper's circle or line, begun on the side away from a board on the side `sign` (1: +y)."""
        if trajectory == "circle":
            center, radius = self.point(0.5, 0.0, 0.25), 0.25 * self.scale
            return Circle(center, radius, np.pi if sign > 0 else 0.0)
        return line(self.point(_LINE_X, -_LINE_END_Y * sign, _LINE_Z), self.point(_LINE_X, _LINE_END_Y * sign, _LINE_Z))

    def hand(self, side: Side) -> HandSide:
        """Return where the hand is met on a side."""
        return self.left if side == "+y" else self.right

    def face(self, face: float, side: Side) -> float:
        """Return the distance of a board's face from the plane y = 0 [m] at which it is met where the paper's is."""
        return self.scale * face + (self.hand(side).aside - self.scale * PANDA_SIDE.aside)

    def sentence(self, arm: str) -> str:
        """Say what was done to the paper's paths."""
        return (
            f"The paper's paths for {arm}: {self.scale:.3g} times as large, moved by {self.shift_x:+.2f} m in x and"
            f" {self.shift_z:+.2f} m in z; the board is met on the same part of them."
        )


def placement_for(model: RobotModel) -> Placement:
    """Scale the paper's paths by the arm's reach, and shrink or move them as little as lets the arm follow them.

    All along, hand as in the ready posture, the arm keeps away from singularities, its limits and itself. Raises
    ExperimentError where no such place is found. The Panda and the FR3 have the paper's own.
    """
    if model.description.mjcf in (panda().mjcf, fr3().mjcf):
        return Placement()
    by_reach = reach_of(model) / reach_of(RobotModel(panda()))
    left, right = (hand_side(model, side) for side in _SIDES)
    shifts = sorted(product(_SHIFT_M, _SHIFT_M), key=lambda s: s[0] ** 2 + s[1] ** 2)
    for part, (x, z) in product(_SHRINK, shifts):
        placement = Placement(by_reach * part, x, z, left, right)
        if all(_followed(model, placement.path(trajectory, 1.0)) for trajectory in ("circle", "line")):
            return placement
    raise ExperimentError(
        f"{model.description.name} can follow the paper's paths nowhere with its hand as in q_ready: give another"
        " q_ready in robot.toml, the hand in front of the base and pointing down."
    )


def hand_side(model: RobotModel, side: Side) -> HandSide:
    """Return where the arm's hand, all that its last joint moves, is widest on a side, posture as in q_ready."""
    kin = model.kinematics(model.description.q_ready)
    hand = model.body.of_links(np.flatnonzero(model.moved_by.all(axis=1)))
    if not len(hand):
        return HandSide(0.02, 0.0)
    ends = np.concatenate([
        kin.position[hand.link] + np.einsum("kij,kj->ki", kin.rotation[hand.link], end) for end in (hand.a, hand.b)
    ])  # fmt: skip
    away = ends - kin.position[model.ee]
    out = sign_of(side) * away[:, 1] + np.tile(hand.radius, 2)
    widest = int(np.argmax(out))
    return HandSide(max(float(out[widest]), 0.02), float(away[widest, 2]))


def _followed(model: RobotModel, path: Path) -> bool:
    """Tell whether an arm can follow a path with its hand upright, well away from where it could not."""
    upright = model.kinematics(model.description.q_ready).rotation[model.ee]
    q = model.description.q_ready
    postures: list[FloatArray] = []
    for phase in np.linspace(0.0, path.length, _PLACES):
        found = _at(model, q, path.point(phase), upright, _ONWARD if postures else _TO_START)
        if found is None:
            return False
        q = found
        postures.append(q)
    ends = capsule_ends(model, kinematics_of(model, np.array(postures)))
    return float(self_distances(model, ends)[:, ever_apart(model)].min(initial=np.inf)) > _CLEAR_M


def _at(model: RobotModel, q: FloatArray, point: FloatArray, upright: FloatArray, pace: Pace) -> FloatArray | None:
    """Move the hand to a point (3,), not turned; None where it does not get there or only just."""

    def error(kin: Kinematics) -> FloatArray:
        return np.concatenate([point - kin.position[model.ee], rotation_error(kin.rotation[model.ee], upright)])

    found = reached(model, q, error, model.description.q_ready, pace)
    if found is None:
        return None
    room = np.minimum(found - model.q_min, model.q_max - found).min()
    singular = np.linalg.svd(model.ee_jacobian(model.kinematics(found)), compute_uv=False)[-1]
    return found if room > _LIMIT_RAD and singular > _SINGULAR else None
