"""The least error that any method of localisation could have: what the torques tell, and no more."""

import numpy as np

from pretouch.params import LocalisationParams, SequentialParams
from pretouch.robot.kinematics import Kinematics
from pretouch.types import FloatArray
from pretouch_lab.bench.contacts import Touching
from pretouch_lab.bench.scenes import model

LINK_M = 0.1
"""Standard deviation of a place on a link of which nothing is known but the link [m]."""
SAMPLES = 6
"""Samples that a window has by the time a contact is judged: 100 ms less what the observer is late."""
_STEP_M = 1e-4


def position_limit(touch: Touching, kin: Kinematics, q: FloatArray, spread: FloatArray) -> float:
    """Return the least standard deviation of a contact's place without a prior, both directions together [m].

    It is the bound of Cramer and Rao. The unknowns are two coordinates on the surface and the force: into it, and in
    two directions across. The noise is what free motion was learnt to be, of the mean of so many independent samples;
    across the surface the force has the spread of `LocalisationParams`. What the torques do not tell at all is bounded
    by the size of a link.

    Args:
        touch: the contact.
        kin: the arm's posture.
        q: (n,) the same [rad].
        spread: (2, 2, n) what was learnt of free motion, see `ResidualModel`.
    """
    p, d, arm = LocalisationParams(), SequentialParams(), model()
    M, moving = arm.mass_matrix(q), spread[1]
    S = (M * moving[0]) @ M.T + np.diag(moving[1] + d.noise_floor_nm**2)
    S = S / SAMPLES + np.diag(np.full(arm.n, d.bias_floor_nm**2))
    R = kin.rotation[touch.link]
    normal, force = R @ touch.normal, touch.force_n * (R @ touch.inwards)
    point = kin.position[touch.link] + R @ touch.point
    own = arm.capsules.of_links(np.array([touch.link]))
    along = _axis_at(own.a, own.b, own.radius, touch.point)
    tangents = [R @ along, np.cross(normal, R @ along[:])]
    radius = float(own.radius.mean())
    columns = []
    for k, tangent in enumerate(tangents):
        turned = _rotation(np.cross(normal, tangent), _STEP_M / radius) if k else np.eye(3)
        ahead = arm.jacobian(kin, touch.link, point + _STEP_M * tangent)[:3].T @ (turned @ force)
        columns.append((ahead - arm.jacobian(kin, touch.link, point)[:3].T @ force) / _STEP_M)
    J = arm.jacobian(kin, touch.link, point)[:3]
    columns += [J.T @ direction for direction in (normal, *tangents)]
    D = np.column_stack(columns)
    across = 1.0 / (p.friction * touch.force_n) ** 2
    prior = np.diag([1 / LINK_M**2, 1 / LINK_M**2, 1 / p.force_n**2, across, across])
    bound = np.linalg.inv(D.T @ np.linalg.solve(S, D) + prior)
    return float(np.sqrt(bound[0, 0] + bound[1, 1]))


def _axis_at(a: FloatArray, b: FloatArray, radius: FloatArray, point: FloatArray) -> FloatArray:
    """Return the direction (3,) of the capsule on whose surface a point (3,) lies."""
    axis = b - a
    part = np.clip(((point - a) * axis).sum(axis=1) / (axis**2).sum(axis=1), 0.0, 1.0)
    far = np.abs(np.linalg.norm(point - a - part[:, None] * axis, axis=1) - radius)
    chosen = axis[int(np.argmin(far))]
    return np.asarray(chosen / np.linalg.norm(chosen))


def _rotation(axis: FloatArray, angle: float) -> FloatArray:
    """Return the rotation (3, 3) by a small angle about an axis (3,)."""
    x, y, z = axis * angle
    return np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])
