"""The paper's paths and board brought into the reach of another arm than a Panda."""

from itertools import product

import numpy as np

from pretouch.control.path import Path
from pretouch.control.task import rotation_error
from pretouch.errors import ExperimentError
from pretouch.importing.reaching import Pace, reached
from pretouch.importing.ready import ever_apart, reach_of
from pretouch.robot.description import panda
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.named import is_shipped
from pretouch.robot.self_distance import capsule_ends, kinematics_of, self_distances
from pretouch.sim.board import HandSide, Side, sign_of
from pretouch.sim.paper_scenes import Placement
from pretouch.types import FloatArray

_SIDES: tuple[Side, Side] = ("+y", "-y")
_SHRINK = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
_SHIFT_M = (0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15, 0.2, -0.2)
"""What is tried, the nearest to the paper first: parts of the scale by reach, shifts along x and z."""
_PLACES, _JOINTS = 48, 6
_TO_START, _ONWARD = Pace(300, 0.1, 1e-6, 0.05), Pace(30, 0.1, 1e-6, 0.05)
_SINGULAR, _LIMIT_RAD, _CLEAR_M = 0.05, 0.05, 0.01
"""What the arm has to keep all along: smallest singular value, distance from joint limits, and from itself."""


def placement_for(model: RobotModel) -> Placement:
    """Scale the paper's paths by the arm's reach, and shrink or move them as little as lets the arm follow them.

    All along, hand as in the ready posture, the arm keeps away from singularities, its limits and itself. Raises
    ExperimentError where no such place is found. The Panda and the FR3 have the paper's own.
    """
    if is_shipped(model.description):
        return Placement()
    if model.n < _JOINTS:
        raise ExperimentError(
            f"{model.description.name} has {model.n} joints ({', '.join(model.joints)}): to follow the paths with its"
            f" hand upright an arm needs {_JOINTS}. If its file has more, import it again with another --ee."
        )
    by_reach = reach_of(model) / reach_of(RobotModel(panda()))
    left, right = (hand_side(model, side) for side in _SIDES)
    shifts = sorted(product(_SHIFT_M, _SHIFT_M), key=lambda s: s[0] ** 2 + s[1] ** 2)
    for part, (x, z) in product(_SHRINK, shifts):
        placement = Placement(by_reach * part, x, z, left, right)
        paths = (placement.path(trajectory, 1.0) for trajectory in ("circle", "line"))
        if all(postures_along(model, path) is not None for path in paths):
            return placement
    raise ExperimentError(
        f"{model.description.name} cannot follow the paper's paths anywhere with its hand as in q_ready: give another"
        " q_ready in robot.toml, with the hand in front of the base and pointing down."
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


def postures_along(model: RobotModel, path: Path) -> FloatArray | None:
    """Return postures (S, n) [rad] along a path, hand upright; None where the arm cannot follow it, or only just."""
    upright = model.kinematics(model.description.q_ready).rotation[model.ee]
    q = model.description.q_ready
    postures: list[FloatArray] = []
    for phase in np.linspace(0.0, path.length, _PLACES):
        found = _at(model, q, path.point(phase), upright, _ONWARD if postures else _TO_START)
        if found is None:
            return None
        q = found
        postures.append(q)
    found = np.array(postures)
    ends = capsule_ends(model, kinematics_of(model, found))
    clear = float(self_distances(model, ends)[:, ever_apart(model)].min(initial=np.inf))
    return found if clear > _CLEAR_M else None


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
