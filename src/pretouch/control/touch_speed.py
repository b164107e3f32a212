"""The speed at which a touch is allowed: from the arm's mass along the normal and what a body region bears."""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import forward
from pretouch.compiled import compiled
from pretouch.params.anticipation import REGIONS, BrakingParams, EffectiveMass
from pretouch.types import FloatArray


class TouchLimits(NamedTuple):
    """What a touch may be."""

    force_n: float
    """Force it may reach in the spring model [N]."""
    stiffness_n_m: float
    """Stiffness of the body region [N/m]."""
    mass_kg: float
    """Mass of the body region [kg]."""
    speed_max_m_s: float
    """Largest speed, whatever the mass [m/s]."""


def touch_limits(params: BrakingParams) -> TouchLimits:
    """Return what `touch_speed` takes of the parameters; without an effective mass only the largest speed counts."""
    mass = params.effective_mass or EffectiveMass()
    region = REGIONS[mass.body_region]
    return TouchLimits(mass.allowed_force_n, region.stiffness_n_m, region.mass_kg, params.touch_speed_max_m_s)


@compiled
def touch_speed(mass: float, limits: TouchLimits) -> float:
    """Speed v_c = F / sqrt(mu k) [m/s], 1/mu = 1/m_H + 1/m_R, at which two masses meet over a spring with force F.

    The spring model of ISO/TS 15066, annex A, for orientation. `mass` m_R [kg] is that of the arm along the normal,
    infinite where it cannot move.
    """
    # all of 1/2 mu v^2 goes into the spring, F^2 / (2 k); an infinite mass leaves mu = m_H
    inverse = 1.0 / limits.mass_kg + 1.0 / mass
    return min(limits.speed_max_m_s, limits.force_n * np.sqrt(inverse / limits.stiffness_n_m))


@compiled
def mass_along(L: FloatArray, row: FloatArray) -> float:
    """Effective mass 1 / (g M^-1 g^T) [kg] along a row g = n^T J (n,), of a mass matrix M = L L^T; infinite for g = 0.

    Khatib (1995): the inertial properties perceived at a point, along a direction.
    """
    inverse = forward(L, row, np.empty(len(row)))  # g M^-1 g^T = |L^-1 g|^2
    return 1.0 / inverse if inverse > 0 else np.inf
