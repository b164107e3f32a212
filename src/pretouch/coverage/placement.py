"""The paper's paths and board brought into the reach of another arm than a Panda."""

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np

from pretouch.control.path import Path
from pretouch.control.posture import brought_to
from pretouch.control.task import rotation_error
from pretouch.errors import ExperimentError
from pretouch.importing.reaching import Pace, reached
from pretouch.importing.ready import ever_apart, reach_of
from pretouch.robot.description import panda
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.named import is_shipped
from pretouch.robot.self_distance import capsule_ends, kinematics_of, pairs_apart, segment_distance, self_distances
from pretouch.sim.board import HandSide, Side, sign_of
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.plant_params import assumed_plant
from pretouch.sim.scene import SceneSpec
from pretouch.types import BoolArray, FloatArray

_SIDES: tuple[Side, Side] = ("+y", "-y")
_SHRINK = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
_SHIFT_M = (0.0, 0.05, -0.05, 0.1, -0.1, 0.15, -0.15, 0.2, -0.2)
"""What is tried, the nearest to the paper first: parts of the scale by reach, shifts along x and z."""
_PATHS = (("circle", -1.0), ("circle", 1.0), ("line", -1.0), ("line", 1.0))
"""What is to be followed, begun on either side: an arm may come to the other end in another posture."""
_PLACES, _JOINTS = 48, 6
_TO_START, _ONWARD = Pace(300, 0.1, 1e-6, 0.05), Pace(30, 0.1, 1e-6, 0.05)
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
    """Scale the paper's paths by the arm's reach, and shrink or move them as little as lets the arm follow them.

    All along, hand as in the ready posture, the arm keeps away from singularities, its limits, itself and the floor,
    and its joints hold its weight. A person's hand is then held beside the circle where the whole free arm passes it
    by as much as the Panda's hand does. Raises ExperimentError where no such place is found. The Panda and the FR3 have
    the paper's own. The last arm's is kept: the search takes seconds.
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
    apart, refused = ever_apart(model, 2 * _CLEAR_M), Counter[str]()  # less room is the arm's make, not the posture's
    for part, (x, z) in product(_SHRINK, shifts):
        placement = Placement(by_reach * part, x, z, left, right)
        try:
            around = [_followed(model, placement.path(name, sign), apart) for name, sign in _PATHS]
        except _NotFollowed as reason:
            refused[str(reason)] += 1
        else:
            return _visited(model, placement, np.concatenate(around[:2]))
    why = ", ".join(f"{reason} ({times})" for reason, times in refused.most_common(2))
    raise ExperimentError(
        f"{model.description.name} cannot follow the paper's paths anywhere with its hand as in q_ready: of"
        f" {refused.total()} sizes and places, {why}. Give another q_ready in robot.toml, with the hand in front of the"
        " base and pointing down, or correct its limits there and its capsules in arm.xml."
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
    if not len(hand):
        return HandSide(0.02, 0.0)
    ends = np.concatenate([
        kin.position[hand.link] + np.einsum("kij,kj->ki", kin.rotation[hand.link], end) for end in (hand.a, hand.b)
    ])  # fmt: skip
    away = ends - kin.position[model.ee]
    out = sign_of(side) * away[:, 1] + np.tile(hand.radius, 2)
    widest = int(np.argmax(out))
    return HandSide(max(float(out[widest]), 0.02), float(away[widest, 2]))


class _NotFollowed(Exception):
    """Why an arm cannot follow a path."""


def _followed(model: RobotModel, path: Path, apart: BoolArray) -> FloatArray:
    """Return postures (S, n) in which an arm follows a path with its hand upright, from where experiments begin."""
    upright = model.kinematics(model.description.q_ready).rotation[model.ee]
    q = model.description.q_ready
    postures: list[FloatArray] = []
    for phase in np.linspace(0.0, path.length, _PLACES):
        found = _at(model, q, path.point(phase), upright, _ONWARD if postures else _TO_START)
        if found is None:
            raise _NotFollowed("the hand does not get everywhere without a singularity or a joint limit")
        q = found if postures else brought_to(model, path.point(phase))
        postures.append(q)
    _check_room(model, np.array(postures), apart)
    _check_torques(model, postures)
    return np.array(postures)


def _check_room(model: RobotModel, postures: FloatArray, apart: BoolArray) -> None:
    """Refuse postures (S, n) in which an arm comes near itself, of the pairs that `apart` (P,) names, or the floor."""
    ends = capsule_ends(model, kinematics_of(model, postures))
    between = self_distances(model, ends)[:, apart]
    if between.min(initial=np.inf) <= _CLEAR_M:
        nearest = pairs_apart(model)[apart][int(between.min(axis=0).argmin())]
        links = " and ".join(model.links[model.capsules.link[c]] for c in nearest)
        raise _NotFollowed(f"{links} come within {1000 * _CLEAR_M:.0f} mm of each other")
    moved = np.isin(model.capsules.link, model.body.link)
    heights = ends[:, moved][..., 2] - model.capsules.radius[moved, None]
    if heights.min(initial=np.inf) <= SceneSpec().floor_height + _CLEAR_M:
        raise _NotFollowed("the arm meets the floor")


def _check_torques(model: RobotModel, postures: list[FloatArray]) -> None:
    """Refuse postures that the joints can barely hold."""
    weight = [model.mass_matrix_and_bias(q, np.zeros(model.n), np.zeros(model.n))[1] for q in postures]
    part = np.abs(weight).max(axis=0) / model.description.tau_max
    weakest = int(part.argmax())
    if part[weakest] > _HELD:
        raise _NotFollowed(f"{model.joints[weakest]} needs more than {100 * _HELD:.0f} % of its torque to hold the arm")


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
