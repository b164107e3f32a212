"""Postures: inverse kinematics by damped least squares, and how near an arm comes to itself in many at once.

Pairs of links that are fixed to each other, or that a single joint parts, are left out: how near they come is settled
by the joint's range, and at the joint their capsules overlap whatever the posture. All other pairs count, the base's
too. Of the Panda's and the FR3's, each comes apart somewhere, and several can collide within the joints' ranges: the
hand and the last link with the forearm, the forearm with the upper arm.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.robot.kinematics import Kinematics, rotation_error
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray

_TRIED = 100
"""Postures in which pairs of links may come apart."""


class Reaching(NamedTuple):
    """How a hand is brought to a place."""

    steps: int
    """At most."""
    step_max: float
    """Largest motion of a joint in one step, within which the Jacobian is taken for constant [rad]."""
    damping: float
    """Of the pseudo-inverse: near singularities the hand is slow, and drawn off its place by `pull`."""
    pull: float = 0.0
    """Part of the way to the posture at rest that is gone in one step, as far as the hand stays where it is."""
    close: float = 1e-4
    """Largest entry of the error of a hand that is there [m, rad]."""


def posture_at(
    model: RobotModel, q: FloatArray, error_of: Callable[[Kinematics], FloatArray], rest: FloatArray, way: Reaching
) -> FloatArray | None:
    """Move an arm from q (n,) until its hand is where it is to be; None where its joint limits are in the way.

    `error_of` gives the motion (6,) that the end-effector still has to make, translation [m] then rotation [rad];
    `rest` is the posture (n,) that the arm is drawn to [rad].
    """
    for _ in range(way.steps):
        kin = model.kinematics(q)
        error = error_of(kin)
        if np.abs(error).max() < way.close:
            return q
        J, drawn = model.ee_jacobian(kin), way.pull * (rest - q)
        # damped least squares: no step explodes near a singularity, and elsewhere the damping costs a few steps more
        step = drawn + J.T @ np.linalg.solve(J @ J.T + way.damping * np.eye(6), error - J @ drawn)
        q = np.clip(q + step * min(1.0, way.step_max / max(np.abs(step).max(), 1e-12)), model.q_min, model.q_max)
    return None


def brought_to(model: RobotModel, point: FloatArray) -> FloatArray:
    """Joint positions (n,) [rad] of the ready posture, its hand moved to a point (3,) [m] without being turned.

    Raises ExperimentError where the arm cannot reach it within its joint limits.
    """
    ready = model.description.q_ready
    upright = model.kinematics(ready).rotation[model.ee]

    def error(kin: Kinematics) -> FloatArray:
        # metres and radians side by side; the sine of the angle will do, for the hand is never turned far
        return np.concatenate([point - kin.position[model.ee], rotation_error(kin.rotation[model.ee], upright)])

    q = posture_at(model, ready.copy(), error, ready, Reaching(2000, 0.02, 1e-4, close=1e-6))
    if q is None:
        raise ExperimentError(
            f"The arm cannot reach {np.round(point, 3).tolist()} with its hand upright: choose another."
        )
    return q


def kinematics_of(model: RobotModel, q: FloatArray) -> Kinematics:
    """Compute poses and joint axes in S postures q (S, n) [rad]: each array of `Kinematics` by posture."""
    return Kinematics(*map(np.array, zip(*(model.kinematics(row) for row in q), strict=True)))


def capsule_ends(model: RobotModel, kin: Kinematics) -> FloatArray:
    """Where both ends of the axes of all C capsules are in S postures (S, C, 2, 3) [m], base frame."""
    body = model.capsules
    ends = np.stack([body.a, body.b], axis=1)
    return kin.position[:, body.link, None] + ends @ kin.rotation[:, body.link].swapaxes(-1, -2)


def self_distances(model: RobotModel, ends: FloatArray) -> FloatArray:
    """Distances (S, P) [m] between the surfaces of the pairs of `RobotModel.apart`, negative in penetration.

    Args:
        model: the arm.
        ends: (S, C, 2, 3) of `capsule_ends`.
    """
    first, second = model.apart.T
    a, b, radius = ends[:, first], ends[:, second], model.capsules.radius
    return segment_distance(a[..., 0, :], a[..., 1, :], b[..., 0, :], b[..., 1, :]) - radius[first] - radius[second]


def spread(count: int, dimensions: int, skip: int = 20) -> FloatArray:
    """Points (count, dimensions) of the unit cube: multiples of an irrational vector after the first (Roberts 2018)."""
    step = 2.0
    for _ in range(40):  # the root of x^(d + 1) = x + 1
        step = (1 + step) ** (1 / (dimensions + 1))
    multiple = np.arange(1 + skip, 1 + skip + count)[:, None]
    return np.asarray(multiple / step ** np.arange(1, dimensions + 1) % 1.0)


def ever_apart(model: RobotModel, by: float = 0.0) -> BoolArray:
    """Whether the pairs (P,) of `RobotModel.apart` come apart, by more than `by` [m], in some of many postures.

    In a short wrist not all do; nor does an upper arm that turns close above its base, whatever the posture.
    """
    q = model.q_min + spread(_TRIED, model.n) * (model.q_max - model.q_min)
    ends = capsule_ends(model, kinematics_of(model, q))
    return np.asarray(np.any(self_distances(model, ends) > by, axis=0))


def segment_distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Distances (...) [m] from segments a to b to segments c to d, each (..., 3); see `nearest_points`."""
    on_first, on_second = nearest_points(a, b, c, d)
    return np.linalg.norm(on_first - on_second, axis=-1)


def nearest_points(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where segments a to b and c to d, each (..., 3), are nearest to each other, on each (..., 3) [m].

    A segment may be a point. The nearest point of the one is that nearest to the line of the other, moved into its
    segment; then each is once brought to where it is nearest to the other (Ericson, Real-Time Collision Detection,
    5.1.9). Of parallel segments any nearest pair will do.
    """
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = (_dot(*pair) for pair in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    area = uu * vv - uv * uv
    on_first = _within(uv * vw - uw * vv, np.where(area > 1e-12 * uu * vv, area, 0.0))
    on_second = _within(uv * on_first + vw, vv)
    on_first = _within(uv * on_second - uw, uu)
    return a + on_first[..., None] * u, c + on_second[..., None] * v


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("...i,...i->...", a, b)


def _within(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Quotient brought into 0 to 1; 0 where the denominator is."""
    none = denominator <= 0.0
    return np.where(none, 0.0, np.clip(numerator / np.where(none, 1.0, denominator), 0.0, 1.0))
