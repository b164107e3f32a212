"""Parameters of the sequential contact test (docs/explanation/detection.md), and of what units tell it."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, NonNegative, Positive


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
