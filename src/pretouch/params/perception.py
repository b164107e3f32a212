"""Parameters of perception: from readings to obstacle points (eq. 1)."""

from dataclasses import dataclass

from pretouch.checks import Checked, NonNegative, Positive, PositiveCount
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class ClosingSpeed(Checked):
    """Estimate of the speed with which an object itself comes nearer."""

    memory_s: Positive = 0.09
    """Time in which the weight of a reading falls by 1/e [s]: ours. A change of speed is followed to half in 0.14 s and
    to nine tenths in 0.34 s; a range noise of 20 mm at 50 Hz leaves 0.05 m/s."""


@dataclass(frozen=True)
class OutsidePoints(Checked):
    """Obstacle points of outside sources, such as cameras."""

    per_link: PositiveCount = 2
    """Points that are kept for each link that moves, in different directions from it."""
    margin_m: NonNegative = 0.05
    """A point is taken as the arm or a fixture up to this from its surface, and its uncertainty [m]: 20 mm by which
    links may differ from their capsules, 15 mm that posture and latency leave, 15 mm of edges: ours."""
    persistence_s: Positive = 0.15
    """How long a point is kept after the measurement that showed it [s]: 60 ms of latency and two lost frames of a
    camera at 30 Hz."""
    hidden_s: NonNegative = 3.0
    """How long a point is kept where the arm has come so near to it that it would be taken for the arm [s]: what a
    source shows there says nothing. At 0.03 m/s, about a touch speed, it is the way through that margin. 0: as any
    other point."""
    slow_after_s: Positive = 0.2
    """Age of a source's newest measurement at which the arm begins to slow [s]: `persistence_s`, and another frame."""
    silent_after_s: Positive = 0.4
    """Age of a source's newest measurement at which the arm holds [s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_order(self)


@dataclass(frozen=True)
class PerceptionParams(Checked):
    """From readings to obstacle points (eq. 1)."""

    persistence_s: Positive = 0.06
    """How long a sensed point is kept after the measurement that showed it [s]: two missed readings at 50 Hz."""
    self_margin_m: NonNegative | None = 0.06
    """A reading is taken as the arm or a fixture, and left out, from this much before its predicted return [m]: twice
    the VL53L1X ranging error of 25 mm, and 10 mm of pose error. None: all readings count as obstacles."""
    self_aside_m: NonNegative = 0.0
    """By how much the arm or a fixture may lie beside what a unit is believed to see, and be left out where a reading
    is within that margin of it [m]. `pretouch` has 5 mm: one that a ruler placed saw the arm itself half the time."""
    spread_sigmas: NonNegative = 2.0
    """Standard deviations of a unit's place by which what it shows counts as nearer, and as the arm or a fixture
    earlier [1]: ours, about 95 % along one direction. It has no effect where the skin says no uncertainty."""
    slow_after_s: Positive = 0.1
    """Age of a unit's newest telling reading at which the arm begins to slow [s]."""
    silent_after_s: Positive = 0.3
    """Age of a unit's newest telling reading at which it counts as silent and the arm holds [s]."""

    reckon_below_minimum: bool = False
    """Whether something nearer than a sensor measures (40 mm) stays where it was last seen, rather than at 40 mm."""
    place_at_stamp: bool = False
    """Whether a reading is placed from where its unit was when it measured, by the joint velocities since, rather than
    from where it is now: late readings of an arm that moves at 0.3 m/s are 15 mm off after 50 ms."""
    keep_while_silent: bool = False
    """Whether the point that a unit showed last is kept until it tells something else, or counts as silent: silence
    is never free space. Off, it goes after `persistence_s`."""
    out_of_view_s: NonNegative = 0.0
    """How long a point is kept from which the arm has carried its unit's beam away, so that no reading says it is gone
    [s]: worth it with sensors with zones (docs/results/skins.md). 0: as any other point."""
    closing: ClosingSpeed | None = None
    """Whether the objects' own closing speeds are estimated, `Obstacles.closing_speed`."""
    outside: OutsidePoints | None = None
    """Points of outside sources, such as cameras; none: they are not looked at."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_order(self)


def _check_order(params: PerceptionParams | OutsidePoints) -> None:
    if params.slow_after_s >= params.silent_after_s:
        raise ParameterError(
            f"{type(params).__name__}.slow_after_s is {params.slow_after_s}: it must be less than silent_after_s,"
            f" {params.silent_after_s}."
        )
