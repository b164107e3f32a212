"""The speed at which a touch is allowed: from the arm's mass along the normal and what a body region bears."""

import numpy as np

from pretouch.cholesky import forward
from pretouch.compiled import compiled
from pretouch.params.anticipation import REGIONS, AnticipationParams
from pretouch.types import FloatArray


def touch_parameters(params: AnticipationParams) -> FloatArray:
    """Force [N], stiffness [N/m], mass [kg] and cap [m/s] (4,) of `touch_speed`."""
    region = REGIONS[params.body_region]
    return np.array((
        params.allowed_force_n, region.stiffness_n_m, region.mass_kg, params.touch_speed_max_m_s,
    ))  # fmt: skip


@compiled
def touch_speed(mass: float, limits: FloatArray) -> float:
    """Speed v_c = F / sqrt(mu k) [m/s], 1/mu = 1/m_H + 1/m_R, at which two masses meet over a spring with force F.

    The spring model of ISO/TS 15066, annex A, for orientation. `mass` m_R [kg] is that of the arm along the normal,
    infinite where it cannot move; `limits` (4,) are those of `touch_parameters`, the last of them the most it may be.
    """
    force, stiffness, body_mass, most = limits[0], limits[1], limits[2], limits[3]
    inverse = 1.0 / body_mass + 1.0 / mass
    return min(most, force * np.sqrt(inverse / stiffness))


@compiled
def mass_along(L: FloatArray, row: FloatArray) -> float:
    """Effective mass 1 / (g M^-1 g^T) [kg] along a row g = n^T J (n,), of a mass matrix M = L L^T; infinite for g = 0.

    Khatib (1995): the inertial properties perceived at a point, along a direction.
    """
    inverse = forward(L, row, np.empty(len(row)))
    return 1.0 / inverse if inverse > 0 else np.inf
