"""Parameters of what nearness does to motion: slowing (eqs. 3-4) and restricting (eqs. 5-7)."""

from dataclasses import dataclass
from typing import Literal

from pretouch.checks import Checked, Negative, NonNegative, Positive, PositiveCount
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class ReductionParams(Checked):
    """Slowing the end-effector (eqs. 3-4)."""

    enabled: bool = True
    """Whether what is near slows the arm. A unit that falls silent slows it in any case."""
    d_max_m: Positive = 0.8
    """Distance from the end-effector origin within which an obstacle slows the arm [m] (Table I)."""
    l_max_cycles: PositiveCount = 200
    """Control cycles until full speed is restored after the obstacle vanished (Table I, at 100 Hz)."""


RestrictionMode = Literal["off", "hard", "slack", "floor", "braking", "flacco", "ding"]


@dataclass(frozen=True)
class RestrictionParams(Checked):
    """Restricting the body's approach to obstacles (eqs. 5-7)."""

    mode: RestrictionMode = "slack"
    """off: no rows. hard: rows as written, no slack. slack: a weighted slack for each row. floor: as slack, with
    the limit never below `floor_m_s`. braking: in place of eqs. 5-7 the braking curve of `AnticipationParams` from
    `d_notice_m` on, slack as well. flacco and ding: in place of eqs. 5-7 a published method to compare with
    (params/baselines.py)."""
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
    """Smallest approach limit in mode floor, v_f [m/s]."""
    slack_weight: Positive = 1000.0
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_notice_m <= self.d_crit_m:
            raise ParameterError(
                f"RestrictionParams.d_notice_m is {self.d_notice_m}: it must be greater than d_crit_m, {self.d_crit_m}."
            )
