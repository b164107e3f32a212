"""What is asked of a motion for calibration."""

from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, NonNegative, Positive
from pretouch.errors import ParameterError

Share = Annotated[float, Check(low=0.0, high=1.0, open_low=True)]


@dataclass(frozen=True)
class PlanParams(Checked):
    """What a motion for calibration consists of, and what it keeps to. Figures without a source are ours."""

    duration_s: Annotated[float, Check(low=0.0, open_low=True, high=90.0)] = 60.0
    """Duration of all of it [s]."""
    poses: Annotated[int, Check(low=1, high=30)] = 6
    """Postures in which the arm stands for a while, beside its start."""
    dwell_s: Positive = 1.5
    """How long it stands in each [s]."""
    swings: Annotated[int, Check(low=1, high=10)] = 3
    """In how many of them it then swings: all joints at once, by two sines each."""
    slowest_hz: Positive = 0.2
    """Frequency of the slowest sine [Hz]."""
    fastest_hz: Annotated[float, Check(low=0.0, open_low=True, high=2.0)] = 1.2
    """Frequency of the fastest sine [Hz]; no two have the same."""
    reach_rad: Positive = 0.5
    """Furthest from its position at the start [rad] a joint is where the arm stands: less, and the arm needs less room.
    Swings go beyond."""
    margin_rad: NonNegative = 0.1
    """Distance kept from joint limits, and from where a speed envelope lets a joint no longer move [rad]."""
    speed_share: Share = 0.5
    """Share of the joint velocity limits that is used."""
    acceleration_share: Share = 0.5
    """Share of the joint acceleration limits that is used."""
    speed_m_s: Positive = 0.7
    """Largest speed of any part of the arm [m/s]."""
    clearance_m: NonNegative = 0.03
    """Distance kept between parts of the arm, and from the floor [m]."""
    floor_m: Annotated[float, Check()] = 0.0
    """Height of what is below the arm, base frame [m]: by default what the base stands on."""
    variant: Annotated[int, Check(low=0, high=1000)] = 0
    """Another number, another motion: of use where the room does not allow the one that was planned."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.slowest_hz >= self.fastest_hz:
            raise ParameterError(
                f"PlanParams.slowest_hz is {self.slowest_hz}: it must be less than fastest_hz, {self.fastest_hz}."
            )
