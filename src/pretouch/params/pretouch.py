"""Parameters beyond the paper: sequential test, localisation, braking curve, and motion in the null space.

Their sources are docs/explanation/detection.md, localization.md and anticipation.md.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class ProximityPriorParams(Checked):
    """How something near raises the prior of a contact there, with a force away from it."""

    gain: Annotated[float, Check(low=1.0, high=1e4)] = 100.0
    """Times the prior is larger, at most, where something is about to touch [1]. It is never lowered: what no unit
    sees keeps the prior it has without a skin."""
    distance_m: Positive = 0.25
    """Body distance from which the prior rises [m], less what is closed in `horizon_s`."""
    horizon_s: Positive = 0.2
    """Time for which the closing speed counts [s]."""


@dataclass(frozen=True)
class TouchSensorParams(Checked):
    """How a unit's touch sensor raises the prior of a contact on its link while it is touched.

    It does by so much that false touches at the rate below make the false alarms of the whole arm no more than twice as
    many.
    """

    false_touches_per_hour: Positive = 1.0
    """How often a unit says that it is touched while it is not [1/h]: an assumption, on the cautious side. The fewer,
    the more a touch counts."""
    false_touch_s: Positive = 0.5
    """How long it then says so [s]: an assumption."""
    fresh_s: Positive = 0.06
    """Age up to which a touch reading counts [s]: two missed ones at 50 Hz."""
    patience_s: Positive = 10.0
    """Time for which a unit is believed to be touched [s]: from then on it is taken to be stuck."""
    forgiveness: Annotated[float, Check(low=0.001, high=1.0)] = 0.1
    """Seconds of that time that a second untouched gives back [1]: in the long run a unit is believed to be touched
    for at most about so large a part of the time."""


@dataclass(frozen=True)
class MisfitParams(Checked):
    """How the test covers what the model of free motion cannot express, and how its level follows what it measures.

    Measured on simulated arms as unkind as real ones (world `hard`, development seeds): docs/explanation/detection.md.
    """

    memory_s: Positive = 300.0
    """Time over which the scatter of the windows' means is averaged [s]. Shorter, a push that grows slowly where no
    unit sees it is learnt away: with 30 s one of six that grew by 1 N/s, with 300 s none."""


@dataclass(frozen=True)
class SequentialParams(Checked):
    """A test on the torques less their learnt mean in free motion."""

    false_alarms_per_hour: Annotated[float, Check(low=1e-4, high=3600.0)] = 1.0
    """Bound on the rate of false alarms with nothing near [1/h], if free motion is as learnt."""
    slack_nats: NonNegative = 7.0
    """How far below its bound ln R may be a contact [1], for Markov's inequality is not tight: as far as free motion
    leaves it, or, without `misfit`, always. 18 simulated arms came to 4.4 in 1.5 h, where the bound is 12.8."""
    contact_gain: Positive = 15.0
    """Times the spread of the torques is larger with a contact, in each direction it can push [1]: best for what is
    just large enough to be found."""
    tails: Annotated[float, Check(low=3.0, high=1000.0)] = 20.0
    """Degrees of freedom of the Student distribution of free motion: one outlier alone is no contact. In the world
    `hard` 30 gave twice as many false alarms, and 10 missed nine times as many contacts."""
    proximity: ProximityPriorParams | None = field(default_factory=ProximityPriorParams)
    """How something near raises the prior of a contact there; None: not at all."""
    learn: Literal["watched", "always", "never"] = "watched"
    """When mean and spread of free motion are learnt. watched: while a skin watches; without one, the arm keeps what it
    had learnt before. always: without a skin too. never: they stay as they began."""
    clear_m: Positive = 0.3
    """Body distance within which nothing may be, for free motion to be learnt [m]."""
    suspect: Annotated[float, Check(low=0.05, high=1.0)] = 0.6
    """Evidence from which a contact is suspected, so that nothing is learnt from before or after it [1]."""
    relearn_after_s: NonNegative = 5.0
    """Time after which a residual is learnt that looks like a contact and that all the while, with nothing near, the
    same weight gripped or put down explains, or the same small torque on one joint [s]; 0: never. The arm waits so
    long."""
    widen_at_turns: bool = True
    """Whether it is learnt how much less of free motion is known where the arm accelerates hard, as where it turns
    round."""
    memory_s: Positive = 10_000.0
    """Time in which what was learnt of the mean fades towards not knowing [s]. One that forgets in 300 s follows what
    sticks and who leans on the arm: in the world `hard` it gave three times as many false alarms."""
    spread_memory_s: Positive = 30.0
    """Time over which the spread is averaged [s]."""
    observer_gain_1_s: Positive = 60.0
    """Gain of the robot's own observer [1/s]: how late its torques follow the motion."""
    offset_prior_nm: Positive = 0.7
    """Standard deviation of a joint's constant offset before anything is learnt [Nm]."""
    friction_prior_nm: Positive = 1.0
    """Standard deviation of the friction terms of a joint before anything is learnt [Nm]."""
    mass_prior: Positive = 0.05
    """Standard deviation of the relative error of each link's mass before anything is learnt [1]."""
    payload_prior_kg: Positive = 0.1
    """Standard deviation of the unknown payload before anything is learnt [kg]."""
    velocity_prior_rad_s2: Positive = 1.0
    """Noise of the measured joint velocities, times the observer's gain, before anything is learnt [rad/s^2]: twice
    that of 0.008 rad/s and 60 1/s, logged on a real Panda."""
    torque_prior_nm: Positive = 0.5
    """What each joint's torque adds to that before anything is learnt [Nm]."""
    noise_floor_nm: Positive = 0.03
    """Smallest spread of a sample of a joint's torque [Nm]."""
    bias_floor_nm: Positive = 0.06
    """Smallest standard deviation of the error of the learnt mean [Nm]; 0.03 gave twice as many false alarms."""
    still_rad_s: Positive = 0.02
    """Joint speed below which the arm counts as standing, with a spread of its own [rad/s]."""
    misfit: MisfitParams | None = field(default_factory=MisfitParams)
    """How what the model cannot express is covered; none: not at all, and suspicious samples are not learnt."""


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
        return self.force_fraction * region.force_n * region.transient


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
