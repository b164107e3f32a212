"""A profile: the choice of parts and parameters of a whole controller."""

from dataclasses import dataclass, field

from pretouch.checks import Checked
from pretouch.contact.decaying_velocity import DecayingVelocity
from pretouch.contact.detector import Detector
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import Reaction
from pretouch.params import (
    AnticipationParams,
    BaselineParams,
    FailureParams,
    PerceptionParams,
    ReductionParams,
    RestrictionParams,
    TaskParams,
    WindowParams,
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
    window: WindowParams = field(default_factory=WindowParams)
    """The window of the external force: contacts are told once it is full (eq. 8)."""
    detect: Detector = field(default_factory=MovingThresholds)
    """How a contact is told from free motion (eqs. 9-11)."""
    react: Reaction = field(default_factory=DecayingVelocity)
    """How the arm answers a contact (eq. 12)."""
    failure: FailureParams = field(default_factory=FailureParams)
    baselines: BaselineParams = field(default_factory=BaselineParams)
