"""The paper's paths and board brought into the reach of another arm than a Panda."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from pretouch.control.path import Path
from pretouch.errors import ExperimentError
from pretouch.robot.description import is_shipped
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, kinematics_of, segment_distance, self_distances
from pretouch.sim.paper_scenes import HandSide, Placement, Side, sign_of
from pretouch.sim.plant_params import assumed_plant
from pretouch.sim.scene import SceneSpec
from pretouch.types import FloatArray

_SIDES: tuple[Side, Side] = ("+y", "-y")
_SCALES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
"""What is tried, the paper's own size first."""
_PATHS = (("circle", -1.0), ("circle", 1.0), ("line", -1.0), ("line", 1.0))
"""What is to be followed, begun on either side."""
_PLACES, _JOINTS = 24, 6
_SINGULAR, _LIMIT_RAD, _CLEAR_M = 0.05, 0.05, 0.01
"""What the arm has to keep all along: smallest singular value, distance from joint limits, and from itself."""
_HELD = 0.8
"""Largest part of a joint's torque that may go into holding the arm: what is left has to move it."""
_BESIDE_M, _INSIDE_M = 0.078, 0.0
"""How far the centre of a person's hand is from the arm where it is nearest: as the Panda's hand passes it."""
_STEP_M, _STEPS = 0.005, 400
"""How far from the plane y = 0 these places are searched for, from far to near."""


@lru_cache(maxsize=1)
def placement_for(model: RobotModel) -> Placement:
    """Shrink the paper's paths towards the arm's base as little as lets the arm follow them.

    All along, hand as in the ready posture, the arm keeps away from singularities, its limits, itself and the floor,
    and its joints hold its weight. A person's hand is then held beside the circle where the whole free arm passes it
    by as much as the Panda's hand does. Raises ExperimentError where no such size is found. The Panda and the FR3 have
    the paper's own. The last arm's is remembered.
    """
    if is_shipped(model.description):
        return Placement()
    if model.n < _JOINTS:
        raise ExperimentError(
            f"{model.description.name} has {model.n} joints ({', '.join(model.joints)}): to follow the paths with its"
            f" hand upright an arm needs {_JOINTS}. If its file has more, import it again with another --ee."
        )
    left, right = (hand_side(model, side) for side in _SIDES)
    reasons = dict[str, None]()
    for scale in _SCALES:
        placement = Placement(scale, left=left, right=right)
        try:
            around = [_followed(model, placement.path(name, sign)) for name, sign in _PATHS]
        except _NotFollowed as reason:
            reasons[str(reason)] = None
        else:
            return _visited(model, placement, np.concatenate(around[:2]))
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


def _visited(model: RobotModel, placement: Placement, postures: FloatArray) -> Placement:
    """Place the hands of people beside the circle and in the way of an arm that goes through postures (S, n)."""
    ends = capsule_ends(model, kinematics_of(model, postures))
    moved = np.isin(model.capsules.link, model.body.link)
    a, b, radius = ends[:, moved][:, :, 0], ends[:, moved][:, :, 1], model.capsules.radius[moved]
    beside, inside = list[float](), list[float]()
    for sign in (-1.0, 1.0):
        x, _, z = placement.visited("beside", sign)
        aside = _STEP_M * np.arange(_STEPS, 0.0, -1.0)
        at = np.column_stack([np.full(len(aside), x), sign * aside, np.full(len(aside), z)])[:, None, None]
        free = (segment_distance(a, b, at, at) - radius).min(axis=(1, 2))
        if not (free < _INSIDE_M).any():
            raise ExperimentError(
                f"There is no place for a person's hand in the way of {model.description.name}'s hand on the circle, at"
                f" x = {x:.2f} m and z = {z:.2f} m: look at the capsules of its last links in arm.xml."
            )
        beside.append(_last_free(aside, free, _BESIDE_M))
        inside.append(_last_free(aside, free, _INSIDE_M))
    return replace(placement, beside=(beside[0], beside[1]), inside=(inside[0], inside[1]))


def _last_free(aside: FloatArray, free: FloatArray, clear: float) -> float:
    """Come in from the side as far as nothing of the arm is nearer than `clear` [m]."""
    return float(aside[max(int(np.argmax(free < clear)) - 1, 0)])


def hand_side(model: RobotModel, side: Side) -> HandSide:
    """Return where the arm's hand, all that its last joint moves, is widest on a side, posture as in q_ready."""
    kin = model.kinematics(model.description.q_ready)
    hand = model.body.of_links(np.flatnonzero(model.moved_by.all(axis=1)))
    if not len(hand.radius):
        return HandSide(0.02, 0.0)
    ends = np.concatenate([
        kin.position[hand.link] + np.einsum("kij,kj->ki", kin.rotation[hand.link], end) for end in (hand.a, hand.b)
    ])  # fmt: skip
    away = ends - kin.position[model.ee]
    out = sign_of(side) * away[:, 1] + np.tile(hand.radius, 2)
    widest = int(np.argmax(out))
    return HandSide(max(float(out[widest]), 0.02), float(away[widest, 2]))


_OUT_OF_REACH = "the hand does not get everywhere without a singularity or a joint limit"


class _NotFollowed(Exception):
    """Why an arm cannot follow a path."""


def _followed(model: RobotModel, path: Path) -> FloatArray:
    """Return postures (S, n) in which an arm follows a path with its hand upright."""
    points = [path.point(phase) for phase in np.linspace(0.0, path.length, _PLACES)]
    try:
        postures = np.array([brought_to(model, point) for point in points])
    except ExperimentError as error:
        raise _NotFollowed(_OUT_OF_REACH) from error
    room = np.minimum(postures - model.q_min, model.q_max - postures).min()
    singular = [np.linalg.svd(model.ee_jacobian(model.kinematics(q)), compute_uv=False)[-1] for q in postures]
    if room <= _LIMIT_RAD or min(singular) <= _SINGULAR:
        raise _NotFollowed(_OUT_OF_REACH)
    _check_room(model, postures)
    _check_torques(model, postures)
    return postures


def _check_room(model: RobotModel, postures: FloatArray) -> None:
    """Refuse postures (S, n) in which an arm comes near the floor, or near itself where it does not when ready."""
    ends = capsule_ends(model, kinematics_of(model, np.vstack([model.description.q_ready, postures])))
    between = self_distances(model, ends)
    between = between[1:, apart := between[0] > 2 * _CLEAR_M]
    if between.min(initial=np.inf) <= _CLEAR_M:
        nearest = model.apart[apart][int(between.min(axis=0).argmin())]
        links = " and ".join(model.links[model.capsules.link[c]] for c in nearest)
        raise _NotFollowed(f"{links} come within {1000 * _CLEAR_M:.0f} mm of each other")
    moved = np.isin(model.capsules.link, model.body.link)
    heights = ends[1:, moved][..., 2] - model.capsules.radius[moved, None]
    if heights.min(initial=np.inf) <= SceneSpec().floor_height + _CLEAR_M:
        raise _NotFollowed("the arm meets the floor")


def _check_torques(model: RobotModel, postures: FloatArray) -> None:
    """Refuse postures (S, n) that the joints can barely hold."""
    weight = [model.mass_matrix_and_bias(q, np.zeros(model.n), np.zeros(model.n))[1] for q in postures]
    part = np.abs(weight).max(axis=0) / model.description.tau_max
    weakest = int(part.argmax())
    if part[weakest] > _HELD:
        raise _NotFollowed(f"{model.joints[weakest]} needs more than {100 * _HELD:.0f} % of its torque to hold the arm")
