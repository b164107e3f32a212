"""A profile: the choice of parts and parameters of a whole controller."""

from dataclasses import dataclass, field

from pretouch.checks import Checked
from pretouch.control import braking_curve as braking_curve  # part of what `Restriction` may be
from pretouch.control.interface import Restriction
from pretouch.control.restriction import ApproachRestriction
from pretouch.params import (
    DetectionParams,
    FailureParams,
    LocalisationParams,
    NullSpaceMotion,
    PerceptionParams,
    ReactionParams,
    SpeedReduction,
    TaskParams,
    ThresholdParams,
)


@dataclass(frozen=True)
class Profile(Checked):
    """A named set of parameters for the whole controller."""

    name: str = "paper"
    """Name shown in tables and files."""
    perception: PerceptionParams = field(default_factory=PerceptionParams)
    task: TaskParams = field(default_factory=TaskParams)
    slow: SpeedReduction | None = field(default_factory=SpeedReduction)
    """What slows the arm near obstacles (eq. 3); none: nothing but silent units does."""
    approach: Restriction | None = field(default_factory=ApproachRestriction)
    """What keeps the body from what is near (eqs. 5-7, or other rows of the QP); none: nothing does."""
    null_space: NullSpaceMotion | None = None
    """Whether links before the hand move away from what is near in the null space of the task."""
    threshold: ThresholdParams = field(default_factory=ThresholdParams)
    reaction: ReactionParams = field(default_factory=ReactionParams)
    failure: FailureParams = field(default_factory=FailureParams)
    detection: DetectionParams = field(default_factory=DetectionParams)
    localisation: LocalisationParams = field(default_factory=LocalisationParams)

    @property
    def d_max_m(self) -> float:
        """Distance from the end-effector origin within which something is near it [m]: of eq. 3, or Table I's."""
        return (self.slow or SpeedReduction()).d_max_m
