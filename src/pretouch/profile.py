"""A profile: the choice of parts and parameters of a whole controller."""

from dataclasses import dataclass, field

from pretouch.checks import Checked
from pretouch.params import (
    AnticipationParams,
    BaselineParams,
    DetectionParams,
    FailureParams,
    LocalisationParams,
    PerceptionParams,
    ReactionParams,
    ReductionParams,
    RestrictionParams,
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
    reduction: ReductionParams = field(default_factory=ReductionParams)
    restriction: RestrictionParams = field(default_factory=RestrictionParams)
    anticipation: AnticipationParams = field(default_factory=AnticipationParams)
    threshold: ThresholdParams = field(default_factory=ThresholdParams)
    reaction: ReactionParams = field(default_factory=ReactionParams)
    failure: FailureParams = field(default_factory=FailureParams)
    detection: DetectionParams = field(default_factory=DetectionParams)
    localisation: LocalisationParams = field(default_factory=LocalisationParams)
    baselines: BaselineParams = field(default_factory=BaselineParams)
