"""Scenes of the paper's experiments: a board beside the arm's path (IV-A), a person who pushes it (IV-C).

And how paths, board and person are brought into the reach of another arm than a Panda.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pretouch.control.path import Circle, Path, segment
from pretouch.errors import ExperimentError, PathError
from pretouch.robot.description import is_shipped
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, kinematics_of, self_distances
from pretouch.sim.hand import FACES, Push, against
from pretouch.sim.plant_params import assumed_plant
from pretouch.sim.scene import Box, SceneSpec
from pretouch.types import FloatArray

FACE_M = 0.25
"""Distance of the board's face from the plane y = 0 [m]."""
_HALF_SIZE_M = (0.15, 0.02, 0.12)
"""Half the size of the board [m]."""
_OUTWARDS_M = 0.12
"""Its centre is this much farther from the base in x than the hand that meets it [m]."""


@dataclass(frozen=True)
class HandSide:
    """Position of the side of the robot's hand that meets the board, hand as in the ready posture."""

    aside: float = 0.102
    """Distance outwards from the end-effector's origin, along y [m]; the Panda's."""
    above: float = 0.057
    """Height above the end-effector's origin [m]; the Panda's."""


PANDA_SIDE = HandSide()
SIGNS = {"-y": -1.0, "+y": 1.0}
"""Sign of y by the side of the base that a board stands on."""


def board_beside(
    path: Path, side: str, stiffness: float, face: float = FACE_M, aside: float = 0.0, above: float = 0.0,
    hand: HandSide = PANDA_SIDE,
) -> Box:  # fmt: skip
    """Return a board, 0.3 m by 0.24 m, where the robot's hand on a path first meets its plane.

    It does not reach inwards to where the forearm, which is wider than the hand, would meet it first.

    Args:
        path: of the end-effector; one that never comes near the board's plane is a PathError.
        side: on which side of the base the board stands, of `SIGNS`.
        stiffness: of the board [N/m].
        face: distance of its face from the plane y = 0 [m].
        aside: by how much it is moved along x [m].
        above: by how much it is moved along z [m].
        hand: where the side of the hand is that meets it.
    """
    sign = SIGNS[side]
    ahead = map(path.point, np.linspace(0.0, path.length, 2000))
    meeting = next((p for p in ahead if sign * p[1] >= face - hand.aside), None)
    if meeting is None:
        raise PathError(f"The path never comes to the board at y = {sign * face:g} m: choose another path or side.")
    x, z = meeting[0] + _OUTWARDS_M + aside, meeting[2] + hand.above + above
    return Box("object", (x, sign * (face + _HALF_SIZE_M[1]), z), _HALF_SIZE_M, stiffness)


_LINE_END_Y, _LINE_X, _LINE_Z = 0.5, 0.4, 0.5
_CENTER, _RADIUS_M = (0.5, 0.0, 0.25), 0.25
_FACE_SPREAD_M = 0.05
"""The seed moves the board's face by up to this [m]."""
_CENTER_SPREAD_M = 0.02
"""The seed moves the board along x and z by up to this [m]."""
_STARTS_S = (4.0, 13.0, 22.0)
_FORCE_N = (15.0, 30.0)
_LASTING_S = (0.2, 0.5)


@dataclass(frozen=True)
class Placement:
    """Placement of the paper's paths for an arm: p = scale * p_paper, in the base frame."""

    scale: float = 1.0
    left: HandSide = PANDA_SIDE
    """Side of the hand that meets a board at +y."""
    right: HandSide = PANDA_SIDE
    """Side of the hand that meets a board at -y."""

    def point(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return where a point of the paper is for this arm [m]."""
        return self.scale * x, self.scale * y, self.scale * z

    def path(self, trajectory: str, sign: float) -> Path:
        """Return the paper's circle or line, begun on the side away from a board on the side `sign` (1: +y)."""
        if trajectory == "circle":
            return Circle(self.point(*_CENTER), _RADIUS_M * self.scale, np.pi if sign > 0 else 0.0)
        return segment(
            self.point(_LINE_X, -_LINE_END_Y * sign, _LINE_Z), self.point(_LINE_X, _LINE_END_Y * sign, _LINE_Z)
        )

    def hand(self, side: str) -> HandSide:
        """Return where the hand is met on a side."""
        return self.left if side == "+y" else self.right

    def face(self, face: float, side: str) -> float:
        """Return the distance of a board's face from the plane y = 0 [m] at which it is met where the paper's is."""
        return self.scale * face + (self.hand(side).aside - self.scale * PANDA_SIDE.aside)

    def paths_sentence(self, arm: str) -> str:
        """Say what was done to the paper's paths."""
        return (
            f"The paper's paths for {arm}: {self.scale:.3g} times as large and as far from the base; the board is met"
            " on the same part of them."
        )


_UNMOVED = Placement()


def static_path(trajectory: str, side: str, placement: Placement = _UNMOVED) -> Path:
    """Return the paper's path, begun on the side away from the object so that the arm runs into it at speed."""
    return placement.path(trajectory, SIGNS[side])


def static_scene(trajectory: str, side: str, stiffness: float, seed: int, placement: Placement = _UNMOVED) -> SceneSpec:
    """Return a board on one side, at another place with each seed."""
    rng = np.random.default_rng([seed, 10])
    face = FACE_M + _FACE_SPREAD_M * rng.uniform(-1, 1)
    aside, above = _CENTER_SPREAD_M * rng.uniform(-1, 1, 2)
    way, hand = static_path(trajectory, side, placement), placement.hand(side)
    return SceneSpec((board_beside(way, side, stiffness, placement.face(face, side), aside, above, hand),))


def dynamic_pushes(seed: int) -> tuple[Push, ...]:
    """Three pushes against different faces, in an order, direction, size and length the seed decides."""
    rng = np.random.default_rng([seed, 11])
    planned = []
    for start, which in zip(_STARTS_S, rng.permutation(len(FACES)), strict=True):
        inwards = against(FACES[which], rng)
        planned.append(Push(start + rng.uniform(0, 2), inwards, rng.uniform(*_FORCE_N), rng.uniform(*_LASTING_S)))
    return tuple(planned)


_SCALES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
"""Scales that are tried, the paper's own size first."""
_PATHS = (("circle", -1.0), ("circle", 1.0), ("line", -1.0), ("line", 1.0))
"""Paths to follow, begun on either side."""
_PLACES, _JOINTS = 24, 6
_SINGULAR, _LIMIT_RAD, _CLEAR_M = 0.05, 0.05, 0.01
"""Bounds all along a path: smallest singular value, distance from joint limits, and from itself."""
_HELD = 0.8
"""Largest part of a joint's torque that may go into holding the arm: what is left has to move it."""


@lru_cache(maxsize=1)
def placement_for(model: RobotModel) -> Placement:
    """Shrink the paper's paths towards the arm's base as little as lets the arm follow them.

    All along, hand as in the ready posture, the arm keeps away from singularities, its limits, itself and the floor,
    and its joints hold its weight. Raises ExperimentError where no such size is found. The Panda and the FR3 have the
    paper's own. The last arm's is remembered.
    """
    if is_shipped(model.description):
        return Placement()
    if model.n < _JOINTS:
        raise ExperimentError(
            f"{model.description.name} has {model.n} joints ({', '.join(model.joints)}): to follow the paths with its"
            f" hand upright an arm needs {_JOINTS}. If its file has more, import it again with another --ee."
        )
    right, left = (hand_side(model, side) for side in SIGNS)
    reasons = dict[str, None]()
    for scale in _SCALES:
        placement = Placement(scale, left=left, right=right)
        try:
            for name, sign in _PATHS:
                _check_path(model, placement.path(name, sign))
        except ExperimentError as reason:
            reasons[str(reason)] = None
        else:
            return placement
    raise ExperimentError(
        f"{model.description.name} cannot follow the paper's paths with its hand as in q_ready, in no size from"
        f" {_SCALES[0]:g} to {_SCALES[-1]:g}: {'; '.join(reasons)}. Give another q_ready in robot.toml, with the hand"
        " in front of the base and pointing down, correct its limits there and its capsules in arm.xml, or give a path"
        " of your own."
    )


def assumptions(model: RobotModel, placement: Placement) -> tuple[str, ...]:
    """Say what a simulation of an arm assumes, a sentence each; nothing of one that comes with the package.

    Nothing is said of paths that are where the paper has them.
    """
    arm = model.description
    if is_shipped(arm):
        return ()
    return (*((placement.paths_sentence(arm.name),) if placement != Placement() else ()), assumed_plant(arm))


def hand_side(model: RobotModel, side: str) -> HandSide:
    """Return where the arm's hand, all that its last joint moves, is widest on a side, posture as in q_ready."""
    kin = model.kinematics(model.description.q_ready)
    hand = model.body.of_links(np.flatnonzero(model.moved_by.all(axis=1)))
    if not len(hand.radius):
        return HandSide(0.02, 0.0)
    ends = [kin.position[hand.link] + np.einsum("kij,kj->ki", kin.rotation[hand.link], end) for end in (hand.a, hand.b)]
    away = np.concatenate(ends) - kin.position[model.ee]
    out = SIGNS[side] * away[:, 1] + np.tile(hand.radius, 2)
    widest = int(np.argmax(out))
    return HandSide(max(float(out[widest]), 0.02), float(away[widest, 2]))


def _check_path(model: RobotModel, path: Path) -> None:
    """Raise why an arm cannot follow a path with its hand upright, if it cannot."""
    points = [path.point(phase) for phase in np.linspace(0.0, path.length, _PLACES)]
    out_of_reach = ExperimentError("the hand does not get everywhere without a singularity or a joint limit")
    try:
        postures = np.array([brought_to(model, point) for point in points])
    except ExperimentError as error:
        raise out_of_reach from error
    room = np.minimum(postures - model.q_min, model.q_max - postures).min()
    singular = [np.linalg.svd(model.ee_jacobian(model.kinematics(q)), compute_uv=False)[-1] for q in postures]
    if room <= _LIMIT_RAD or min(singular) <= _SINGULAR:
        raise out_of_reach
    _check_room(model, postures)
    _check_torques(model, postures)


def _check_room(model: RobotModel, postures: FloatArray) -> None:
    """Refuse postures (S, n) in which an arm comes near the floor, or near itself where it does not when ready."""
    ends = capsule_ends(model, kinematics_of(model, np.vstack([model.description.q_ready, postures])))
    between = self_distances(model, ends)
    between = between[1:, apart := between[0] > 2 * _CLEAR_M]
    if between.min(initial=np.inf) <= _CLEAR_M:
        nearest = model.apart[apart][int(between.min(axis=0).argmin())]
        links = " and ".join(model.links[model.capsules.link[c]] for c in nearest)
        raise ExperimentError(f"{links} come within {1000 * _CLEAR_M:.0f} mm of each other")
    moved = np.isin(model.capsules.link, model.body.link)
    heights = ends[1:, moved][..., 2] - model.capsules.radius[moved, None]
    if heights.min(initial=np.inf) <= SceneSpec().floor_height + _CLEAR_M:
        raise ExperimentError("the arm meets the floor")


def _check_torques(model: RobotModel, postures: FloatArray) -> None:
    """Refuse postures (S, n) that the joints can barely hold."""
    weight = [model.mass_matrix_and_bias(q, np.zeros(model.n), np.zeros(model.n))[1] for q in postures]
    part = np.abs(weight).max(axis=0) / model.description.tau_max
    weakest = int(part.argmax())
    if part[weakest] > _HELD:
        raise ExperimentError(
            f"{model.joints[weakest]} needs more than {100 * _HELD:.0f} % of its torque to hold the arm"
        )
