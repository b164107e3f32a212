"""What is not known of where a unit sits, and where in a zone a target lies, as a length at the point: its spread."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import Kinematics, SkinArrays
from pretouch.types import FloatArray, IntArray, Number


@compiled
def spread(sigmas: float, position_sigma: Number, orientation_sigma: Number, distance: Number) -> Number:
    """Spread u = n sqrt(sigma_p^2 + (d sigma_r)^2) [m]: how far a point may lie from where eq. 1 puts it.

    `sigmas` n counts standard deviations, those of the unit's position [m] and orientation [rad] in the worst
    direction; `distance` d [m] is from the unit to the point.
    """
    turned = distance * orientation_sigma  # to first order: lever times angle
    return sigmas * np.sqrt(position_sigma * position_sigma + turned * turned)


@compiled
def widen(
    ends: FloatArray, sigmas: float, position_sigma: FloatArray, orientation_sigma: FloatArray, distance: FloatArray,
    most: float,
) -> None:  # fmt: skip
    """Add to `ends` (K,) [m], up to which the arm and fixtures explain a reading, its spread, but no more than `most`.

    `distance` (K,) [m] is what each reading stands for.
    """
    for k in range(len(ends)):
        # an obstacle so close before the arm is not seen: `most` bounds how much a badly placed unit may hide
        ends[k] += min(spread(sigmas, position_sigma[k], orientation_sigma[k], distance[k]), most)


@compiled
def bring_nearer(
    body_distance: FloatArray, ee_distance: FloatArray, point: FloatArray, unit: IntArray, sigmas: float,
    skin: SkinArrays, kin: Kinematics,
) -> None:  # fmt: skip
    """Take its spread off the distances (M,) [m] of each point (M, 3), as far as the unit (M,) now is from it.

    The distance from the body may become negative, that from the end-effector is at least 0: eq. 3 makes a factor on
    the speed of it.
    """
    for m in range(len(point)):
        k = unit[m]
        # from the unit as it is now, not as it measured: at 5 degrees u is off by 3 mm at most, without a memory of it
        origin, R, away2 = kin.position[skin.link[k]], kin.rotation[skin.link[k]], 0.0
        for i in range(3):
            at = origin[i]
            for j in range(3):
                at += R[i, j] * skin.T_link_sensor[k, j, 3]
            away2 += (point[m, i] - at) ** 2
        turned = np.sqrt(skin.orientation_sigma[k] ** 2 + skin.cones.spread[skin.cones.kind[k]] ** 2)
        u = spread(sigmas, skin.position_sigma[k], turned, np.sqrt(away2))
        body_distance[m] -= u
        ee_distance[m] = max(0.0, ee_distance[m] - u)
