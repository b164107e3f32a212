"""Every parameter of the controller: value, unit, meaning, source. Table I of the paper gives the defaults.

A profile is a frozen set of them. `replace(profile, ...)` of the standard library makes a variant, checked again.
"""

from pretouch.params.anticipation import AnticipationParams as AnticipationParams
from pretouch.params.anticipation import BodyRegion as BodyRegion
from pretouch.params.baselines import BaselineParams as BaselineParams
from pretouch.params.detection import DetectionParams as DetectionParams
from pretouch.params.failure import FailureParams as FailureParams
from pretouch.params.localisation import LocalisationParams as LocalisationParams
from pretouch.params.near import ReductionParams as ReductionParams
from pretouch.params.near import RestrictionMode as RestrictionMode
from pretouch.params.near import RestrictionParams as RestrictionParams
from pretouch.params.perception import PerceptionParams as PerceptionParams
from pretouch.params.profile import PROFILES as PROFILES
from pretouch.params.profile import Profile as Profile
from pretouch.params.profile import at_rate as at_rate
from pretouch.params.profile import profile as profile
from pretouch.params.reaction import ReactionParams as ReactionParams
from pretouch.params.task import Orientation as Orientation
from pretouch.params.task import TaskParams as TaskParams
from pretouch.params.touch import ThresholdParams as ThresholdParams
