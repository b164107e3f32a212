"""Parameters of contact detection: which method, and the numbers of each. See docs/explanation/detection.md."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive, PositiveCount
from pretouch.errors import ParameterError

_LARGEST_NM = 1e4

Method = Literal["thresholds", "fixed", "sequential"]


@dataclass(frozen=True)
class DetectionParams(Checked):
    """How a contact is told from free motion."""

    method: Method = "thresholds"
    """thresholds: the paper's window and bands (eqs. 8-11). fixed: constant bounds on each joint's external torque and
    on the force. sequential: a test on the torques less their learnt free-motion mean."""
    freeze_while_reacting: bool = False
    """Whether the paper's window stands still during a reaction, so that the push does not become its mean and the
    release a contact. Off in the paper; a rebound towards the person in 10 of 15 releases without it (prototype)."""

    joint_torques_nm: tuple[float, ...] = (20.0, 20.0, 18.0, 18.0, 16.0, 14.0, 12.0)
    """Method fixed: bound on each joint's external torque [Nm] (libfranka, examples_common.cpp). An arm with another
    number of joints takes the value at the same place between base and hand."""
    force_n: Positive = 20.0
    """Method fixed: bound on the norm of the force [N] (the same file has 20 to 25)."""

    false_alarms_per_hour: Annotated[float, Check(low=1e-4, high=3600.0)] = 1.0
    """Method sequential: bound on the rate of false alarms with nothing near [1/h], if free motion is as learnt."""
    slack_nats: NonNegative = 7.0
    """How far below its bound ln R stays in free motion [1], for Markov's inequality is not tight. Measured: in 1.5
    hours of free motion of eighteen simulated arms at up to 0.3 m/s ln R came to 4.4 where the bound allows 12.8. With
    0 the bound is proven."""
    contact_gain: Positive = 15.0
    """Times the spread of the torques is larger with a contact, in each direction it can push [1]: best for what is
    just large enough to be found."""
    tails: Annotated[float, Check(low=3.0, high=1000.0)] = 30.0
    """Degrees of freedom of the Student distribution of free motion: one outlier alone is no contact."""

    use_proximity: bool = True
    """Whether something near raises the prior of a contact there, with a force away from it."""
    near_gain: Annotated[float, Check(low=1.0, high=1e4)] = 100.0
    """Times the prior is larger, at most, where something is about to touch [1]. It is never lowered: what no unit
    sees keeps the prior it has without a skin."""
    near_m: Positive = 0.25
    """Body distance from which the prior rises [m], less what is closed in `near_horizon_s`."""
    near_horizon_s: Positive = 0.2
    """Time for which the closing speed counts [s]."""

    use_touch: bool = False
    """Whether a unit's touch sensor raises the prior of a contact on its link while it is touched: by so much that
    false touches at the rate below make the false alarms of the whole arm no more than twice as many."""
    false_touches_per_hour: Positive = 1.0
    """How often a unit says that it is touched while it is not [1/h]: an assumption, on the cautious side. The fewer,
    the more a touch counts."""
    false_touch_s: Positive = 0.5
    """How long it then says so [s]: an assumption."""
    touch_fresh_s: Positive = 0.06
    """Age up to which a touch reading counts [s]: two missed ones at 50 Hz."""
    touch_patience_s: Positive = 10.0
    """Time for which a unit is believed to be touched [s]: from then on it is taken to be stuck."""
    touch_forgiveness: Annotated[float, Check(low=0.001, high=1.0)] = 0.1
    """Seconds of that time that a second untouched gives back [1]: in the long run a unit is believed to be touched
    for at most about so large a part of the time."""
    use_imu: bool = False
    """Whether a jolt that the units' accelerometers feel raises the prior of a contact on the links that explain it."""
    imu_gain: Annotated[float, Check(low=1.0, high=1e4)] = 100.0
    """Times the prior of all links together is larger, at most, after a jolt [1]. It is never lowered."""
    imu_memory_s: Positive = 0.05
    """Time in which that fades to a third [s]: the torques follow an impact so late."""
    imu_contact_gain: Positive = 30.0
    """Times the spread of the accelerations is larger with an impact, in each direction it can push [1]."""
    imu_tails: Annotated[float, Check(low=3.0, high=1000.0)] = 8.0
    """Degrees of freedom of the Student distribution of the accelerations without one: real vibration has outliers."""
    imu_follow_1_s: Positive = 50.0
    """How fast the arm follows a commanded velocity [1/s]: as a critically damped joint impedance of 3000 Nm/rad
    does, that carries 1.2 kg m^2."""
    imu_motion_doubt: Fraction = 0.5
    """Part of what the commanded motion accelerates a unit by that may be otherwise [1], one standard deviation."""
    rotor_kg_m2: NonNegative = 0.1
    """Inertia of a drive at its joint [kg m^2], for what an impact accelerates (as the simulated arm's)."""

    learn: bool = True
    """Whether mean and spread of free motion are learnt; off, they stay as they began."""
    learn_unseen: bool = False
    """Whether they are learnt without a skin that watches. Off, such an arm keeps what it had learnt before."""
    clear_m: Positive = 0.3
    """Body distance within which nothing may be, for free motion to be learnt [m]."""
    suspect: Annotated[float, Check(low=0.05, high=1.0)] = 0.6
    """Evidence from which a contact is suspected, so that nothing is learnt from before or after it [1]."""
    inertia: bool = True
    """Whether what accelerates is part of the mean, as what weighs is: an unknown load's inertia where a path turns
    round."""
    relearn_after_s: NonNegative = 5.0
    """Time after which a residual is learnt that looks like a contact and that all the while, with nothing near, the
    same weight gripped or put down explains, or the same small torque on one joint [s]; 0: never. The arm waits so
    long."""
    widen_at_turns: bool = True
    """Whether it is learnt how much less of free motion is known where the arm accelerates hard, as where it turns
    round."""
    memory_s: Positive = 300.0
    """Time in which what was learnt of the mean fades towards not knowing [s]."""
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
    bias_floor_nm: Positive = 0.03
    """Smallest standard deviation of the error of the learnt mean [Nm]."""
    still_rad_s: Positive = 0.02
    """Joint speed below which the arm counts as standing, with a spread of its own [rad/s]."""
    confirm_samples: PositiveCount = 1
    """Samples in a row with the evidence of a contact that make one."""
    localise: bool = False
    """Method sequential: whether the place of a contact is inferred too (docs/explanation/localization.md)."""

    def __post_init__(self) -> None:
        # a recording holds a list
        object.__setattr__(self, "joint_torques_nm", tuple(float(bound) for bound in self.joint_torques_nm))
        super().__post_init__()
        if not self.joint_torques_nm or not all(0.0 < bound < _LARGEST_NM for bound in self.joint_torques_nm):
            raise ParameterError(
                f"DetectionParams.joint_torques_nm is {self.joint_torques_nm}: give positive torques, one a joint."
            )
