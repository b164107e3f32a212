"""Parameters of what nearness does to motion beyond the paper: the braking curve, and motion in the null space."""

from dataclasses import dataclass
from typing import Literal

from pretouch.checks import Checked, Fraction, NonNegative, Positive
from pretouch.errors import ParameterError

BodyRegion = Literal["hand", "forearm", "upper-arm", "chest", "abdomen", "back", "face", "skull"]


@dataclass(frozen=True)
class Region:
    """Figures of a body region in the spring model of a contact. For orientation: public copies disagree."""

    force_n: float
    """Allowed quasi-static force [N]."""
    stiffness_n_m: float
    """Effective stiffness [N/m]."""
    mass_kg: float
    """Effective mass [kg]."""
    transient: float = 2.0
    """Factor on the force for a short contact; 1 where a short contact is allowed no more than a lasting one."""


REGIONS: dict[BodyRegion, Region] = {
    "hand": Region(140.0, 75_000.0, 0.6),
    "forearm": Region(160.0, 40_000.0, 2.0),
    "upper-arm": Region(150.0, 30_000.0, 3.0),
    "chest": Region(140.0, 25_000.0, 40.0),
    "abdomen": Region(110.0, 10_000.0, 40.0),
    "back": Region(210.0, 35_000.0, 40.0),
    "face": Region(65.0, 75_000.0, 4.4, transient=1.0),
    "skull": Region(130.0, 150_000.0, 4.4, transient=1.0),
}
"""After ISO/TS 15066, annex A, as quoted in public; not checked against the standard, and no claim of conformity."""


@dataclass(frozen=True)
class EffectiveMass(Checked):
    """A touch speed that follows from the arm's mass along the normal and from what a body region bears."""

    body_region: BodyRegion = "face"
    """Which body region's figures the touch speed is for: by default that which gives the least speed, for a unit
    cannot tell what it sees."""
    region_force_n: NonNegative = 0.0
    """Allowed force in place of the region's [N]; 0: the region's own, with its factor for a short contact."""
    force_fraction: Fraction = 0.25
    """Part of the allowed force that a touch may reach in the spring model: ours. Half is for what the arm pushes on
    until it has detected the contact, and half of what is left for figures that public copies disagree on."""
    rotor_inertia_kg_m2: NonNegative = 0.1
    """Inertia of each drive reflected to its joint, added to the arm's [kg m^2] (model data of this package)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force_fraction == 0:
            raise ParameterError("EffectiveMass.force_fraction is 0, so nothing could be touched: give more.")

    @property
    def allowed_force_n(self) -> float:
        """Force that a touch may reach in the spring model [N]."""
        region = REGIONS[self.body_region]
        return self.force_fraction * (self.region_force_n or region.force_n * region.transient)


@dataclass(frozen=True)
class Tangential(Checked):
    """Slowing a point near an object across the normal too."""

    distance_m: Positive = 0.1
    """Body distance below which it is slowed [m]."""
    speed_m_s: Positive = 0.1
    """Speed across the normal at the surface [m/s]; from there it grows linearly to the task's: ours."""


@dataclass(frozen=True)
class BrakingParams(Checked):
    """The braking curve, in place of eqs. 5-7."""

    d_notice_m: Positive = 0.6
    """Body distance from which an approach is restricted [m] (Table I)."""
    deceleration_m_s2: Positive = 0.6
    """Deceleration a of the braking curve [m/s^2]: that with which the curve binds the task's 0.3 m/s from about 0.1 m
    on, Table I's d_crit. From 0.15 to 1 it changes the time to a touch by 0.6 s and its force by nothing
    (docs/explanation/anticipation.md)."""
    latency_s: NonNegative = 0.06
    """Time from a measurement to a motion tau [s]: a reading's period of 20 ms, a network delay of about 12 ms, a
    control period, and the 16 ms of the drives' set-point filter."""
    margin_m: NonNegative = 0.01
    """Taken off each body distance [m]: the ranging offset of a unit (at most 10 mm in the simulation; the data sheet
    of the VL53L1X allows 20 to 25 mm of error in all)."""
    touch_speed_max_m_s: Positive = 0.05
    """Largest touch speed v_c, whatever the body region allows [m/s]: ours; a light arm would otherwise touch faster
    than it was tried. Force against it: docs/explanation/anticipation.md."""
    retreat_max_m_s: NonNegative = 0.1
    """Fastest retreat that an object which comes nearer may ask for [m/s]: ours."""
    tighten_m_s2: Positive = 3.0
    """Rate at which a row may slow the arm [m/s^2]. A row appears at the speed the arm has: no step in the command."""
    loosen_m_s2: Positive = 1.0
    """Rate at which a row gives way, when its object is gone or not heard of too [m/s^2]: the task's acceleration."""
    slack_weight: Positive = 1000.0
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2."""
    effective_mass: EffectiveMass | None = None
    """Whether the touch speed follows from the arm's mass; none: it is `touch_speed_max_m_s`."""
    closing_deadband_m_s: NonNegative | None = None
    """Closing speed of the object itself that is not counted [m/s]; more is taken off what an approach may be, which
    needs `perception.closing`. 0.05 is what range noise of 20 mm leaves in the estimate for an object at rest.
    None: the object's own speed does not count."""
    tangential: Tangential | None = None
    """Whether a point near an object is slowed across the normal too."""


@dataclass(frozen=True)
class NullSpaceMotion(Checked):
    """Links before the hand move away from what is near where that leaves the task as it is."""

    distance_m: Positive = 0.25
    """Body distance below which they do [m]."""
    speed_m_s: Positive = 0.1
    """Speed of the closest point at no distance, growing with the square of what is missing of it [m/s]."""
    joint_rad_s: Positive = 0.5
    """Largest such joint velocity (norm) [rad/s]."""
    rate_rad_s2: Positive = 1.0
    """Rate at which it changes [rad/s^2]."""
