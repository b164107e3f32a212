"""How near an arm comes to itself, in many postures at once.

Pairs of links that are fixed to each other, or that a single joint parts, are left out: how near they come is settled
by the joint's range, and at the joint their capsules overlap whatever the posture. All other pairs count, the base's
too. Of the Panda's and the FR3's, each comes apart somewhere, and several can collide within the joints' ranges: the
hand and the last link with the forearm, the forearm with the upper arm.
"""

import numpy as np

from pretouch.groups import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


def kinematics_of(model: RobotModel, q: FloatArray) -> Kinematics:
    """Compute poses and joint axes in S postures q (S, n) [rad]: each array of `Kinematics` by posture."""
    postures = [model.kinematics(row) for row in q]
    return Kinematics(
        np.array([k.position for k in postures]),
        np.array([k.rotation for k in postures]),
        np.array([k.anchor for k in postures]),
        np.array([k.axis for k in postures]),
    )


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
