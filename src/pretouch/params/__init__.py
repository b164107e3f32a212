"""Every parameter of the controller: value, unit, meaning, source. Table I of the paper gives the defaults.

A profile is a frozen set of them. `replace(profile, ...)` of the standard library makes a variant, checked again.
"""

from pretouch.params.paper import AdmittanceParams as AdmittanceParams
from pretouch.params.paper import ClampParams as ClampParams
from pretouch.params.paper import ClosingSpeed as ClosingSpeed
from pretouch.params.paper import FailureParams as FailureParams
from pretouch.params.paper import GiveUpParams as GiveUpParams
from pretouch.params.paper import Orientation as Orientation
from pretouch.params.paper import OutsidePoints as OutsidePoints
from pretouch.params.paper import PerceptionParams as PerceptionParams
from pretouch.params.paper import PinchParams as PinchParams
from pretouch.params.paper import RestrictionParams as RestrictionParams
from pretouch.params.paper import RowKind as RowKind
from pretouch.params.paper import SpeedReduction as SpeedReduction
from pretouch.params.paper import TaskParams as TaskParams
from pretouch.params.paper import ThresholdParams as ThresholdParams
from pretouch.params.paper import WindowParams as WindowParams
from pretouch.params.pretouch import BodyRegion as BodyRegion
from pretouch.params.pretouch import BrakingParams as BrakingParams
from pretouch.params.pretouch import EffectiveMass as EffectiveMass
from pretouch.params.pretouch import LocalisationParams as LocalisationParams
from pretouch.params.pretouch import MisfitParams as MisfitParams
from pretouch.params.pretouch import NullSpaceMotion as NullSpaceMotion
from pretouch.params.pretouch import ProximityPriorParams as ProximityPriorParams
from pretouch.params.pretouch import SequentialParams as SequentialParams
from pretouch.params.pretouch import Tangential as Tangential
from pretouch.params.pretouch import TouchSensorParams as TouchSensorParams
