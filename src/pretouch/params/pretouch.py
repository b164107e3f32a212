"""Parameters beyond the paper: sequential test, localisation, braking curve, and motion in the null space.

Their sources are docs/explanation/detection.md, localization.md and anticipation.md.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive


@dataclass(frozen=True)
class ProximityPriorParams(Checked):
    """Increase of the prior of a contact by an obstacle that meets the body, with a force away from it."""

    gain: Annotated[float, Check(low=1.0, high=1e4)] = 100.0
    """Largest factor on the prior, for an obstacle that certainly touches [1]. The prior is never lowered: a contact
    that no unit sees keeps the prior it has without a skin."""
    error_m: Positive = 0.05
    """Standard deviation of a body distance [m]: that of ranging, and the part of an object that no unit sees. Hands
    that touched simulated arms were seen at 0.02 to 0.06 m."""
    horizon_s: Positive = 0.2
    """Time before and after now in which a meeting raises the prior [s]."""


@dataclass(frozen=True)
class TouchSensorParams(Checked):
    """Increase of the prior of a contact on a link by a touched unit.

    With it, false touches at the rate below at most double the false alarms of the whole arm.
    """

    false_touches_per_hour: Positive = 1.0
    """Rate of a unit's false touches [1/h]: an assumption, on the cautious side. The lower it is, the more a touch
    counts."""
    false_touch_s: Positive = 0.5
    """Duration of a false touch [s]: an assumption."""
    fresh_s: Positive = 0.06
    """Age up to which a touch reading counts [s]: two missed ones at 50 Hz."""
    patience_s: Positive = 10.0
    """Longest touch of a unit that counts [s]: after that it is assumed to be stuck."""
    forgiveness: Annotated[float, Check(low=0.001, high=1.0)] = 0.1
    """Seconds of that time that an untouched second returns [1]: in the long run the touches of a unit count for at
    most about this part of the time."""


@dataclass(frozen=True)
class SequentialParams(Checked):
    """Test of the torques less their learnt mean in free motion."""

    false_alarms_per_hour: Annotated[float, Check(low=1e-4, high=3600.0)] = 1.0
    """Bound on the rate of false alarms with nothing near [1/h], if free motion is as learnt."""
    slack_nats: NonNegative = 7.0
    """Largest reduction of the level of ln R below its bound [1], for Markov's inequality is not tight: as far as free
    motion allows. 18 simulated arms reached 4.4 in 1.5 h, with a bound of 12.8."""
    contact_gain: Positive = 15.0
    """Ratio of the torques' spread with a contact to that without, in each direction of a push [1]: the best one for
    just detectable forces."""
    tails: Annotated[float, Check(low=3.0, high=1000.0)] = 20.0
    """Degrees of freedom of the Student distribution of free motion: one outlier alone is no contact. In the world
    `hard` 30 gave twice as many false alarms, and 10 missed nine times as many contacts."""
    proximity: ProximityPriorParams | None = field(default_factory=ProximityPriorParams)
    """Increase of the prior of a contact by near obstacles; none: no increase."""
    learn: Literal["watched", "always", "never"] = "watched"
    """Learning of mean and spread of free motion. watched: while a skin watches; without a skin the model does not
    change. always: without a skin too. never: the model stays at its start."""
    clear_m: Positive = 0.3
    """Body distance without obstacles that the learning of a lasting residual requires [m]."""
    suspect: Annotated[float, Check(low=0.05, high=1.0)] = 0.6
    """Evidence from which a contact is suspected [1]: one that has been detected counts on while it is."""
    relearn_after_s: NonNegative = 5.0
    """Time after which a residual that looks like a contact is learnt [s], if without obstacles the same change of a
    load or the same small torque on one joint explains it all the time; 0: never. The arm waits for that time."""
    memory_s: Positive = 10_000.0
    """Time in which the knowledge of the mean fades towards the prior [s]. With 300 s the mean follows friction and
    people who lean on the arm: in the world `hard` that gave three times as many false alarms."""
    spread_memory_s: Positive = 30.0
    """Averaging time of the spread [s]."""
    scatter_memory_s: Positive = 300.0
    """Averaging time of the scatter of the windows' means [s]. A shorter one learns slow pushes that no unit sees as
    free motion: with 30 s one of six that grew by 1 N/s, with 300 s none."""
    observer_gain_1_s: Positive = 60.0
    """Gain of the robot's own observer [1/s]: the delay of its torques."""
    offset_prior_nm: Positive = 0.7
    """Prior standard deviation of a joint's constant offset [Nm]."""
    friction_prior_nm: Positive = 1.0
    """Prior standard deviation of the friction terms of a joint [Nm]."""
    presliding_rad: Positive = 0.02
    """Way of a joint in which its friction at rest becomes another [rad]."""
    mass_prior: Positive = 0.05
    """Prior standard deviation of the relative error of each link's mass [1]."""
    payload_prior_kg: Positive = 0.1
    """Prior standard deviation of the unknown payload [kg]."""
    velocity_prior_rad_s2: Positive = 1.0
    """Prior noise of the measured joint velocities, times the observer's gain [rad/s^2]: twice that of 0.008 rad/s and
    60 1/s, logged on a real Panda."""
    torque_prior_nm: Positive = 0.5
    """Prior further noise of each joint's torque [Nm]."""
    noise_floor_nm: Positive = 0.03
    """Smallest spread of a sample of a joint's torque [Nm]."""
    bias_floor_nm: Positive = 0.06
    """Smallest standard deviation of the error of the learnt mean [Nm]; 0.03 gave twice as many false alarms."""
    still_rad_s: Positive = 0.02
    """Joint speed below which the arm counts as at rest, with a spread of its own [rad/s]."""


@dataclass(frozen=True)
class LocalisationParams(Checked):
    """Localisation of a contact by its torques; `detect.localise` switches it on."""

    friction: Positive = 0.25
    """Standard deviation of the force in each direction across the surface, as a part of the force into it [1]: that of
    forces spread evenly over a cone of friction 0.5, about that of skin and cloth on smooth plastic (Derler and
    Gerhardt 2012)."""
    force_n: Positive = 40.0
    """Prior standard deviation of the force into the surface [N]: a firm push by hand; harder ones are inferred too,
    for the torques then outweigh the prior."""
    relative: Fraction = 0.06
    """Error of the torques as a part of them [1]: kinematics, reversal of friction by the push, motion within the
    window."""
    tails: Annotated[float, Check(low=3.0, high=1000.0)] = 30.0
    """Degrees of freedom of the Student distribution of the error, as in the detector."""
    independent_s: Positive = 0.01
    """Time after which the noise of a sample of the torques is independent [s]: the best of 5, 10, 20 and 40 ms in
    development trials; the robot's own observer, 60 1/s, forgets in 17 ms."""
    seen_share: Fraction = 0.7
    """Part of the contacts at an obstacle that the skin sees, if it sees one: the share of the contacts of development
    trials on the links 3 to 7 whose hand a skin of 32 units saw."""
    seen_m: Positive = 0.06
    """Standard deviation of the distance between the touched place and the point that a unit sees of the object [m]:
    the view is from the side, 50 to 100 mm from the place in development trials with hands of 50 mm."""
    near_m: Positive = 0.25
    """Body distance within which an obstacle counts [m], as in the detector."""
    unit_share: Fraction = 0.95
    """Probability that a reported touch is true [1]: a patch of 2 cm is 0.2 % of a Panda's surface and has false
    touches in 0.014 % of the time (`false_touches_per_hour`, `false_touch_s`), odds of about 14 to 1."""
    unit_m: Positive = 0.015
    """Least standard deviation of the place of a touched unit [m]: that of neighbouring places of the surface."""
    memory_s: NonNegative = 0.15
    """Averaging time of the likelihoods of earlier steps [s]: a moving arm measures one contact in several postures."""
    update_s: Positive = 0.01
    """Least time from one inference to the next [s]."""


@dataclass(frozen=True)
class Tangential(Checked):
    """Limit on the speed of a point near an object across the normal."""

    distance_m: Positive = 0.1
    """Body distance below which the limit applies [m]."""
    speed_m_s: Positive = 0.05
    """Speed across the normal within the margin [m/s]; from there it grows linearly to the task's: about the touch
    speed, for what a unit saw may be larger than the ball that is remembered of it."""


@dataclass(frozen=True)
class BrakingParams(Checked):
    """The braking curve, in place of eqs. 5-7."""

    d_notice_m: Positive = 0.6
    """Body distance from which an approach is restricted [m] (Table I)."""
    deceleration_m_s2: Positive = 0.6
    """Deceleration a of the braking curve [m/s^2]: with it the curve limits the task's 0.3 m/s from about 0.1 m on,
    Table I's d_crit. From 0.15 to 1 it changes the time to a touch by 0.6 s and its force by nothing
    (docs/explanation/anticipation.md)."""
    latency_s: NonNegative = 0.06
    """Latency tau from a measurement to a motion [s]: a reading's period of 20 ms, a network delay of about 12 ms, a
    control period, and the 16 ms of the drives' set-point filter."""
    margin_m: NonNegative = 0.01
    """Margin on each body distance [m]: the ranging offset of a unit (at most 10 mm in the simulation; the data sheet
    of the VL53L1X allows 20 to 25 mm of error in all)."""
    touch_speed_m_s: Positive = 0.04
    """Touch speed v_c [m/s]: in the spring model of ISO/TS 15066, annex A, v_c = F / sqrt(mu k) with a quarter of the
    65 N that a face bears, its 75 N/mm, and a reduced mass mu of 2 kg, the arm's near the ready posture."""
    untouched_s: NonNegative = 0.0
    """Age of a look up to which the arm does not touch what it showed while it moves by itself [s]: it stops at the
    margin, and waits. Older places may be touched at the touch speed. 0: all, for a task that wants contact."""
    retreat_max_m_s: NonNegative = 0.1
    """Fastest retreat from an approaching object [m/s]: ours."""
    tighten_m_s2: Positive = 3.0
    """Rate at which a row may slow the arm [m/s^2]. A row starts at the speed of the arm: no step in the command."""
    loosen_m_s2: Positive = 1.0
    """Rate at which a row loosens, also without its object [m/s^2]: the task's acceleration."""
    slack_weight: Positive = 1000.0
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2."""
    closing_deadband_m_s: NonNegative | None = None
    """Closing speed of the object itself that does not count [m/s]; more of it lowers the approach limit, which needs
    `perception.memory`. Range noise of 20 mm leaves 0.05 in the estimate for an object at rest. None: the object's own
    speed does not count."""
    tangential: Tangential | None = None
    """Limit on the speed across the normal near an object; none: no limit."""


@dataclass(frozen=True)
class NullSpaceMotion(Checked):
    """Motion of links before the hand away from obstacles, in the null space of the task."""

    distance_m: Positive = 0.25
    """Body distance below which they move away [m]."""
    speed_m_s: Positive = 0.1
    """Speed of the closest point at a distance d of 0 [m/s]; it falls by the square of 1 - d / `distance_m`."""
    joint_rad_s: Positive = 0.5
    """Largest norm of these joint velocities [rad/s]."""
    rate_rad_s2: Positive = 1.0
    """Largest rate of their change [rad/s^2]."""


OFFERED = (
    "pretouch: ours. paper: the equations and Table I. paper-off: the same without restrictions."
    " blind: without proximity, eqs. 8-10 with F_obs = 0. slowing-only, thresholds-only: one use of proximity each."
    " paper-0.5m: obstacles count within the 0.5 m of the paper's text (V-C), not Table I's 0.8 m."
)
"""The meaning of each profile, for a person who chooses one."""
