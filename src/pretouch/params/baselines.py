"""Parameters of two published ways to keep clear of obstacles, to compare with: modes flacco and ding.

Values as in the code of the authors of arXiv 2510.24683, who compare the same two with their own controller.
"""

from dataclasses import dataclass

from pretouch.checks import Checked, NonNegative, Positive
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class BaselineParams(Checked):
    """Flacco et al. (ICRA 2012) and Ding and Thomas (ICRA 2020)."""

    flacco_v_max_m_s: Positive = 0.4
    """Largest repulsive velocity of the end-effector V_max [m/s]. An older draft of that code has 0.21."""
    flacco_alpha: Positive = 6.0
    """Steepness alpha of the repulsion [1]."""
    flacco_rho_m: Positive = 0.4
    """Distance rho beyond which there is practically no repulsion [m]."""
    flacco_size_m: NonNegative = 0.0
    """Taken off the distances from the end-effector origin [m]: as published the repulsion knows no size of the hand.
    0.1 is about half the width of the Panda's."""
    ding_repulse_m: Positive = 0.17
    """Body distance below which the retreat is fastest [m]."""
    ding_zero_low_m: Positive = 0.22
    """Body distance from which no retreat is asked [m]."""
    ding_zero_high_m: Positive = 0.25
    """Body distance up to which no approach is allowed [m]."""
    ding_notice_m: Positive = 0.3
    """Body distance from which an approach is not limited [m]."""
    ding_approach_m_s: Positive = 0.2
    """Largest approach, just within `ding_notice_m` [m/s]."""
    ding_retreat_m_s: Positive = 0.2
    """Fastest retreat, below `ding_repulse_m` [m/s]."""
    ding_weighted_m: NonNegative = 4.0
    """Body distance up to which an obstacle enters the weighted sum of distances that must not fall [m]: as published
    all that is seen. With 0.3 it holds where the approach is limited, and with 0 not at all."""

    def __post_init__(self) -> None:
        super().__post_init__()
        p = self
        if not p.ding_repulse_m < p.ding_zero_low_m <= p.ding_zero_high_m < p.ding_notice_m:
            raise ParameterError(
                "BaselineParams.ding_repulse_m, ding_zero_low_m, ding_zero_high_m, ding_notice_m are"
                f" {p.ding_repulse_m}, {p.ding_zero_low_m}, {p.ding_zero_high_m}, {p.ding_notice_m}: they must grow."
            )
