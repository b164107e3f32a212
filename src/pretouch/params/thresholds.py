"""Parameters of the moving contact thresholds (eqs. 9-11)."""

from dataclasses import dataclass
from typing import Literal

from pretouch.checks import Checked, NonNegative, Positive
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class ThresholdParams(Checked):
    """The contact thresholds, which move with the force's statistics and with what is near (eqs. 9-11)."""

    f_base_n: Positive = 10.0
    """Base force F_b above the mean that makes a contact, eq. 9 [N] (Table I)."""
    f_std_n: NonNegative = 3.0
    """Largest addition F_std for a noisy signal, eq. 10 [N] (Table I)."""
    sigma_max_n: Positive = 3.0
    """Standard deviation at which that addition is full, eq. 10 [N] (Table I)."""
    f_d_n: NonNegative = 4.0
    """Largest reduction F_d near an obstacle, eq. 11 [N] (Table I)."""
    d_max_m: Positive = 0.8
    """Distance from the end-effector origin at which the reduction begins, eq. 11 [m] (Table I)."""
    d_min_m: NonNegative = 0.05
    """Distance from the end-effector origin at which it is full, eq. 11 [m] (Table I)."""
    compare: Literal["filtered", "raw"] = "filtered"
    """Which force is held against the thresholds: the newest value in the window (paper) or the raw sample
    (the authors' code)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_max_m <= self.d_min_m:
            raise ParameterError(
                f"ThresholdParams.d_max_m is {self.d_max_m}: it must be greater than d_min_m, {self.d_min_m}."
            )
        if self.f_base_n <= self.f_d_n:
            raise ParameterError(
                f"ThresholdParams.f_base_n is {self.f_base_n}: it must be greater than f_d_n, {self.f_d_n}, or the"
                " thresholds could cross."
            )
