"""The contacts that the sequential test looks for in one posture: given to `sequential.judge`."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.proximity_prior import nearest_of, nearness
from pretouch.robot.model import jacobian_into
from pretouch.types import BoolArray, FloatArray, IntArray


@compiled
def write_hypotheses(
    anchor: FloatArray, axis: FloatArray, position: FloatArray, rotation: FloatArray, moved_by: BoolArray,
    parts: IntArray, middle: FloatArray, qd: FloatArray,
    link: IntArray, body_point: FloatArray, direction: FloatArray, distance: FloatArray, closing: FloatArray,
    touch_gain: FloatArray, gain: float, near: float, horizon: float,
    J: FloatArray, joints: IntArray, weight: FloatArray, away: FloatArray,
) -> None:  # fmt: skip
    """Write Jacobians (H, 3, n), joints (H,), prior weights (n + H,) and directions (H, 3) of the contacts looked for.

    Each joint's weight, then each link's, then those of the nearest objects; see `sequential.judge`. All are times
    `touch_gain` (L,) of the link; of several links behind one joint the largest counts.
    """
    n, count, full, point = len(anchor), len(parts), np.empty((6, len(anchor))), np.empty(3)
    order, k = nearest_of(distance, len(J) - count), 0
    weight[:n] = 0.0
    for body in range(len(moved_by)):
        before = moved_by[body].sum()
        if before:
            weight[before - 1] = max(weight[before - 1], 0.5 / n * touch_gain[body])
    for h in range(len(J)):
        if h < count:
            touched = parts[h]
            weight[n + h] = (0.5 / count) * touch_gain[touched]
            for a in range(3):
                point[a] = position[touched, a]
                for b in range(3):
                    point[a] += rotation[touched, a, b] * middle[h, b]
        else:
            k = order[h - count]
            touched, point[:] = link[k], body_point[k]
        jacobian_into(anchor, axis, moved_by[touched], point, full)
        J[h], joints[h] = full[:3], moved_by[touched].sum()
        if h >= count:
            speed = closing[k]
            for a in range(3):
                away[h, a] = -direction[k, a]
                for j in range(n):
                    speed += direction[k, a] * J[h, a, j] * qd[j]
            weight[n + h] = gain * nearness(distance[k], speed, near, horizon) * touch_gain[touched]
