"""Parameters of the place of a contact. See docs/explanation/localization.md."""

from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive


@dataclass(frozen=True)
class LocalisationParams(Checked):
    """How the place of a contact is inferred from the torques it makes; `detect.localise` switches it on."""

    friction: Positive = 0.25
    """Standard deviation of the force in each direction across the surface, as a part of the force into it [1]: that of
    forces spread evenly over a cone of friction 0.5, about that of skin and cloth on smooth plastic (Derler and
    Gerhardt 2012)."""
    force_n: Positive = 40.0
    """Standard deviation of the force into the surface before anything is measured [N]: a firm push by hand; harder
    ones are believed all the same, for the torques then say far more."""
    relative: Fraction = 0.06
    """Error of the torques as a part of them [1]: kinematics, friction that turns round under the push, motion within
    the window."""
    tails: Annotated[float, Check(low=3.0, high=1000.0)] = 30.0
    """Degrees of freedom of the Student distribution of the error, as in the detector."""
    independent_s: Positive = 0.01
    """Time after which the noise of a sample of the torques counts as new [s]: the best of 5, 10, 20 and 40 ms in
    development trials; the robot's own observer, 60 1/s, forgets in 17 ms."""
    seen_share: Fraction = 0.7
    """Part of the contacts that are by what the skin sees near, if it sees something: the share of the contacts of
    development trials on the links 3 to 7 whose hand a skin of 32 units saw."""
    seen_m: Positive = 0.06
    """How far from the touched place the point lies that a unit sees of what touches, standard deviation [m]: it is
    seen from the side, 50 to 100 mm from the place in development trials with hands of 50 mm."""
    near_m: Positive = 0.25
    """Body distance from which on something seen counts [m], as in the detector."""
    unit_share: Fraction = 0.95
    """Belief in units that say that they are touched [1]: a patch of 2 cm is 0.2 % of a Panda's surface and falsely
    touched in 0.014 % of the time (`false_touches_per_hour`, `false_touch_s`), odds of about 14 to 1."""
    unit_m: Positive = 0.015
    """Least standard deviation of a place they give [m]: that of neighbouring places of the surface."""
    memory_s: NonNegative = 0.15
    """Time over which what the windows of earlier steps said of each place is averaged [s]: an arm that moves shows
    one contact from several postures."""
    update_s: Positive = 0.01
    """Least time from one inference to the next [s]."""
