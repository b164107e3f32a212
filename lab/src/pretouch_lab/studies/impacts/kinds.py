"""The contacts of the study: impacts and pushes, on which links."""

import numpy as np

IMPACTS_M_S = {"impact 0.1": 0.1, "impact 0.2": 0.2, "impact 0.5": 0.5}
"""Speeds of hands that hit the arm [m/s]."""
PUSHES_S = {"push 20": 0.02, "push 100": 0.1, "push 300": 0.3}
"""Times in which a push rises [s]; in as much it falls."""
KINDS = (*IMPACTS_M_S, *PUSHES_S)
GROUPS = {"upper arm": ("link2", "link3"), "forearm": ("link4", "link5"), "wrist, hand": ("link6", "link7", "hand")}
LINKS = tuple(link for group in GROUPS.values() for link in group)

_HAND_KG, _ARM_KG, _HAND_N_M = 0.6, 3.0, 75_000.0
"""A hand's effective mass and stiffness (ISO/TS 15066, Table A.3), and about that of a Panda's distal links."""
PUSH_N, HELD_S = 20.0, 0.2
"""Force of a push [N], and for how long it is held [s]."""


def pulse(speed_m_s: float) -> tuple[float, float]:
    """Largest force [N] and duration [s] of an impact: a hand as a mass on a spring, against the arm's mass.

    The force rises and falls linearly, with the peak and the impulse of the half sine it stands for.
    """
    mass = 1.0 / (1.0 / _HAND_KG + 1.0 / _ARM_KG)
    return speed_m_s * float(np.sqrt(_HAND_N_M * mass)), 4.0 * float(np.sqrt(mass / _HAND_N_M))
