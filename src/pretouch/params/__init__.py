"""Every parameter of the controller: value, unit, meaning, source. Table I of the paper gives the defaults.

A profile is a frozen set of them. `replace(profile, ...)` of the standard library makes a variant, checked again.
"""

from typing import TYPE_CHECKING, Any

from pretouch.params.anticipation import BodyRegion as BodyRegion
from pretouch.params.anticipation import BrakingParams as BrakingParams
from pretouch.params.anticipation import EffectiveMass as EffectiveMass
from pretouch.params.anticipation import NullSpaceMotion as NullSpaceMotion
from pretouch.params.anticipation import Tangential as Tangential
from pretouch.params.detection import DetectionParams as DetectionParams
from pretouch.params.failure import FailureParams as FailureParams
from pretouch.params.localisation import LocalisationParams as LocalisationParams
from pretouch.params.near import RestrictionParams as RestrictionParams
from pretouch.params.near import RowKind as RowKind
from pretouch.params.near import SpeedReduction as SpeedReduction
from pretouch.params.perception import PerceptionParams as PerceptionParams
from pretouch.params.reaction import ReactionParams as ReactionParams
from pretouch.params.task import Orientation as Orientation
from pretouch.params.task import TaskParams as TaskParams
from pretouch.params.touch import ThresholdParams as ThresholdParams

if TYPE_CHECKING:
    from pretouch.profile import Profile as Profile
    from pretouch.profiles import PROFILES as PROFILES
    from pretouch.profiles import at_rate as at_rate
    from pretouch.profiles import profile as profile


def __getattr__(name: str) -> Any:
    if name not in ("PROFILES", "Profile", "at_rate", "profile"):
        raise AttributeError(name)
    import pretouch.profiles

    return getattr(pretouch.profiles, name)
