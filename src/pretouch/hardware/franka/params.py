"""How an arm is run in real time."""

from dataclasses import dataclass, field

from pretouch.checks import Checked, Positive
from pretouch.hardware.franka.limits import LimiterParams


@dataclass(frozen=True)
class FrankaParams(Checked):
    """Settings of the process that speaks with the arm."""

    limiter: LimiterParams = field(default_factory=LimiterParams)
    """The way from one set-point to the next."""
    stale_after_s: Positive = 0.05
    """Age at which a set-point no longer counts, and the arm is brought to rest [s]: five periods of a controller at
    100 Hz, from which on the controller itself brakes (`FailureParams.overrun_s`)."""
    end_after_s: Positive = 1.0
    """Age of the newest set-point at which the motion is ended, and has to be begun anew [s]: a program that was
    stopped for that long does not know where the arm is, nor who stands there by now."""
    demand_real_time: bool = False
    """Whether to refuse a kernel without real-time capabilities."""
