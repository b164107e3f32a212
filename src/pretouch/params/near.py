"""Parameters of what nearness does to motion in the paper (eq. 3, eqs. 5-7)."""

from dataclasses import dataclass
from typing import Literal

from pretouch.checks import Checked, Negative, NonNegative, Positive
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class SpeedReduction(Checked):
    """Slowing the end-effector near obstacles (eq. 3). A unit that falls silent slows it with and without this."""

    d_max_m: Positive = 0.8
    """Distance from the end-effector origin within which an obstacle slows the arm [m] (Table I)."""


RowKind = Literal["hard", "slack", "floor"]


@dataclass(frozen=True)
class RestrictionParams(Checked):
    """Restricting the body's approach to obstacles (eqs. 5-7)."""

    rows: RowKind = "slack"
    """hard: rows as written, no slack. slack: a weighted slack for each row. floor: as slack, with the limit never
    below `floor_m_s`."""
    v_max_m_s: Positive = 0.04
    """Largest approach and largest repulsive velocity V_max [m/s] (Table I)."""
    beta: Negative = -10.0
    """Steepness of eqs. 5 and 6 (Table I); negative, so that nearer means slower."""
    d_repulse_m: Positive = 0.1
    """Body distance below which the arm is pushed away [m] (Table I)."""
    d_crit_m: Positive = 0.1
    """Body distance d_crit of eqs. 5 and 6 [m] (Table I)."""
    d_notice_m: Positive = 0.6
    """Body distance from which an approach is restricted [m] (Table I)."""
    floor_m_s: NonNegative = 0.02
    """Smallest approach limit with rows=floor, v_f [m/s]."""
    slack_weight: Positive = 1000.0
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_notice_m <= self.d_crit_m:
            raise ParameterError(
                f"{type(self).__name__}.d_notice_m is {self.d_notice_m}: it must be greater than d_crit_m,"
                f" {self.d_crit_m}."
            )
