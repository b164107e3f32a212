"""Every parameter of the controller: value, unit, meaning, source. Table I of the paper gives the defaults.

A profile is a frozen set of them. `replace(profile, ...)` of the standard library makes a variant, checked again.
"""

from pretouch.params.anticipation import BodyRegion as BodyRegion
from pretouch.params.anticipation import BrakingParams as BrakingParams
from pretouch.params.anticipation import EffectiveMass as EffectiveMass
from pretouch.params.anticipation import NullSpaceMotion as NullSpaceMotion
from pretouch.params.anticipation import Tangential as Tangential
from pretouch.params.failure import FailureParams as FailureParams
from pretouch.params.localisation import LocalisationParams as LocalisationParams
from pretouch.params.near import RestrictionParams as RestrictionParams
from pretouch.params.near import RowKind as RowKind
from pretouch.params.near import SpeedReduction as SpeedReduction
from pretouch.params.perception import ClosingSpeed as ClosingSpeed
from pretouch.params.perception import OutsidePoints as OutsidePoints
from pretouch.params.perception import PerceptionParams as PerceptionParams
from pretouch.params.reaction import AdmittanceParams as AdmittanceParams
from pretouch.params.reaction import ClampParams as ClampParams
from pretouch.params.reaction import GiveUpParams as GiveUpParams
from pretouch.params.reaction import PinchParams as PinchParams
from pretouch.params.sequential import MisfitParams as MisfitParams
from pretouch.params.sequential import ProximityPriorParams as ProximityPriorParams
from pretouch.params.sequential import SequentialParams as SequentialParams
from pretouch.params.sequential import TouchSensorParams as TouchSensorParams
from pretouch.params.task import Orientation as Orientation
from pretouch.params.task import TaskParams as TaskParams
from pretouch.params.thresholds import ThresholdParams as ThresholdParams
from pretouch.params.window import WindowParams as WindowParams
