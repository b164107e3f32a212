"""Postures: inverse kinematics by damped least squares, and self-distances of an arm in many postures at once.

Pairs of links that are fixed to each other, or with a single joint between them, are left out: the joint's range limits
their approach, and at the joint their capsules overlap in any posture. All other pairs count, the base's too. Those of
the Panda and the FR3 all come apart in some posture, and several can collide within the joints' ranges: the hand and
the last link with the forearm, the forearm with the upper arm.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.robot.kinematics import Kinematics, rotation_error
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray

_TRIED = 100
"""Postures in which pairs of links are checked."""


class Reaching(NamedTuple):
    """Parameters of inverse kinematics."""

    steps: int
    """Largest number of steps."""
    step_max: float
    """Largest motion of a joint in one step, for which the Jacobian counts as constant [rad]."""
    damping: float
    """Damping of the pseudo-inverse: near singularities the hand is slow, and `pull` moves it off its place."""
    pull: float = 0.0
    """Part of the motion to the posture at rest in one step, as far as the hand does not move."""
    close: float = 1e-4
    """Largest entry of the error of a hand at its goal [m, rad]."""


def posture_at(
    model: RobotModel, q: FloatArray, error_of: Callable[[Kinematics], FloatArray], rest: FloatArray, way: Reaching
) -> FloatArray | None:
    """Move an arm from q (n,) until its hand is at its goal; None where the joint limits prevent that.

    `error_of` gives the remaining motion (6,) of the end-effector, translation [m] then rotation [rad]; `rest` is the
    posture (n,) to which the arm is pulled [rad].
    """
    for _ in range(way.steps):
        kin = model.kinematics(q)
        error = error_of(kin)
        if np.abs(error).max() < way.close:
            return q
        J, pull = model.ee_jacobian(kin), way.pull * (rest - q)
        # damped least squares: no step explodes near a singularity, and elsewhere the damping costs a few steps more
        step = pull + J.T @ np.linalg.solve(J @ J.T + way.damping * np.eye(6), error - J @ pull)
        q = np.clip(q + step * min(1.0, way.step_max / max(np.abs(step).max(), 1e-12)), model.q_min, model.q_max)
    return None


def brought_to(model: RobotModel, point: FloatArray) -> FloatArray:
    """Return joint positions (n,) [rad] of the ready posture with its hand moved to a point (3,) [m], not turned.

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
    """Return both ends of the axes of all C capsules in S postures (S, C, 2, 3) [m], base frame."""
    body = model.capsules
    ends = np.stack([body.a, body.b], axis=1)
    return kin.position[:, body.link, None] + ends @ kin.rotation[:, body.link].swapaxes(-1, -2)


def self_distances(model: RobotModel, ends: FloatArray) -> FloatArray:
    """Distances (S, P) [m] between the surfaces of the pairs of `RobotModel.apart`, negative in penetration.

    `ends` (S, C, 2, 3) are of `capsule_ends`.
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
    """Return whether the pairs (P,) of `RobotModel.apart` come apart, by more than `by` [m], in some of many postures.

    In a short wrist not all do; nor does an upper arm that turns close above its base in any posture.
    """
    q = model.q_min + spread(_TRIED, model.n) * (model.q_max - model.q_min)
    ends = capsule_ends(model, kinematics_of(model, q))
    return np.asarray(np.any(self_distances(model, ends) > by, axis=0))


def segment_distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Distances (...) [m] from segments a to b to segments c to d, each (..., 3); see `nearest_points`."""
    on_first, on_second = nearest_points(a, b, c, d)
    return np.linalg.norm(on_first - on_second, axis=-1)


def nearest_points(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the nearest points of segments a to b and c to d, each (..., 3), on each (..., 3) [m].

    A segment may be a point. The first point is that nearest to the line of the other segment, moved into its own
    segment; then each is once moved to the point nearest to the other (Ericson, Real-Time Collision Detection, 5.1.9).
    For parallel segments, any nearest pair is right.
    """
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = (np.einsum("...i,...i->...", *pair) for pair in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    area = uu * vv - uv * uv
    on_first = _within(uv * vw - uw * vv, np.where(area > 1e-12 * uu * vv, area, 0.0))
    on_second = _within(uv * on_first + vw, vv)
    on_first = _within(uv * on_second - uw, uu)
    return a + on_first[..., None] * u, c + on_second[..., None] * v


def _within(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return the quotient limited to 0 to 1; 0 where the denominator is 0."""
    none = denominator <= 0.0
    return np.where(none, 0.0, np.clip(numerator / np.where(none, 1.0, denominator), 0.0, 1.0))
