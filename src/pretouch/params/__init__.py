"""Every parameter of the controller: value, unit, meaning, source. Table I of the paper gives the defaults.

This module has those of the paper: perception (eq. 1), task (2), nearness (3-7), thresholds (8-11), failures, reaction
(12); ours are in `params.pretouch`. A profile is a frozen set of them; `replace(profile, ...)` of the standard library
makes a variant, checked again.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, Fraction, Negative, NonNegative, Positive, PositiveCount
from pretouch.errors import ParameterError
from pretouch.params.pretouch import BrakingParams as BrakingParams
from pretouch.params.pretouch import LocalisationParams as LocalisationParams
from pretouch.params.pretouch import NullSpaceMotion as NullSpaceMotion
from pretouch.params.pretouch import ProximityPriorParams as ProximityPriorParams
from pretouch.params.pretouch import SequentialParams as SequentialParams
from pretouch.params.pretouch import Tangential as Tangential
from pretouch.params.pretouch import TouchSensorParams as TouchSensorParams


@dataclass(frozen=True)
class LocalMapParams(Checked):
    """Memory of the places near the arm that were seen occupied (docs/explanation/anticipation.md)."""

    cell_m: Positive = 0.02
    """Edge of a cell, in which one place is remembered [m]; two and four times that for wider looks."""
    fist_m: NonNegative = 0.04
    """Radius of the ball behind a seen surface for which a place stands [m]: half of a fist's width. A unit sees one
    side of an object, and the arm may come from another."""
    mark_m: Positive = 0.8
    """Distance from a unit up to which its readings are remembered [m]: more than a restriction notices."""
    carve_m: Positive = 0.6
    """Distance from a unit up to which it sees a place empty [m]: farther away a zone may miss a fist."""
    tolerance_m: NonNegative = 0.05
    """Distance before a seen surface from which places are empty [m]: three times the noise, and half a footprint."""
    looks: PositiveCount = 3
    """Looks that count for a place: as many see it empty before it is forgotten. One alone lasts as long as a point."""
    kept_s: Positive = 12.0
    """Life of a place that nothing has seen again [s]."""
    per_link: PositiveCount = 6
    """Number of obstacles for each moving link, in different directions from it."""
    closing_s: Positive = 0.09
    """Time in which the weight of a reading in the estimate of an object's own speed falls by 1/e [s]: a change is
    followed to half in 0.14 s and to nine tenths in 0.34 s; a range noise of 20 mm at 50 Hz leaves 0.05 m/s."""


@dataclass(frozen=True)
class OutsidePoints(Checked):
    """Obstacle points of outside sources, such as cameras."""

    margin_m: NonNegative = 0.05
    """Distance from the arm or a fixture up to which a point belongs to it, plus its uncertainty [m]: 20 mm between
    links and their capsules, 15 mm of posture and latency, 15 mm of edges: ours."""
    persistence_s: Positive = 0.15
    """Life of a point after its measurement [s]: 60 ms of latency and two lost frames of a camera at 30 Hz."""
    hidden_s: NonNegative = 12.0
    """Life of a point so near to the arm that it would pass for the arm [s]: measurements there are ambiguous, and the
    arm waits there. As long as that of a place that a unit saw; 0: the life of any other point."""
    slow_after_s: Positive = 0.2
    """Age of a source's newest measurement at which the arm begins to slow [s]: `persistence_s`, and another frame."""
    silent_after_s: Positive = 0.4
    """Age of a source's newest measurement at which the arm holds [s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_order(self)


@dataclass(frozen=True)
class PerceptionParams(Checked):
    """From readings to obstacle points (eq. 1)."""

    persistence_s: Positive = 0.06
    """Life of a sensed point after its measurement [s]: two missed readings at 50 Hz."""
    self_margin_m: NonNegative | None = 0.06
    """Distance before the predicted return of the arm or a fixture from which a reading is left out [m]: twice the
    VL53L1X ranging error of 25 mm, and 10 mm of pose error. None: all readings count as obstacles."""
    self_aside_m: NonNegative = 0.0
    """Distance beside a unit's nominal cone at which the arm or a fixture still explains a reading within that margin
    [m]. `pretouch` has 5 mm: a unit placed with a ruler saw the arm itself half the time."""
    spread_sigmas: NonNegative = 2.0
    """Standard deviations of a unit's pose by which its obstacles count as nearer, and the margin of arm and fixtures
    as larger [1]: ours, about 95 % along one direction. No effect for a skin without uncertainties."""
    slow_after_s: Positive = 0.1
    """Age of a unit's newest informative reading at which the arm begins to slow [s]."""
    silent_after_s: Positive = 0.3
    """Age of a unit's newest informative reading at which it counts as silent and the arm holds [s]."""

    memory: LocalMapParams | None = None
    """Memory of the places that units and outside sources have seen, each reading placed from the pose of its unit at
    the measurement; none: each unit's last point alone, placed from its present pose."""
    outside: OutsidePoints | None = None
    """Points of outside sources, such as cameras, which are remembered; none: they are ignored."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_order(self)
        if self.outside is not None and self.memory is None:
            raise ParameterError("PerceptionParams.outside is set without a memory: set memory, or outside to none.")


def _check_order(params: PerceptionParams | OutsidePoints) -> None:
    if params.slow_after_s >= params.silent_after_s:
        raise ParameterError(
            f"{type(params).__name__}.slow_after_s is {params.slow_after_s}: it must be less than silent_after_s,"
            f" {params.silent_after_s}."
        )


Orientation = Literal["free", "hold"]


@dataclass(frozen=True)
class TaskParams(Checked):
    """Following the path, and the cost of the QP (eq. 2)."""

    speed_m_s: Positive = 0.3
    """Largest end-effector speed along the path [m/s] (paper, IV-A)."""
    acceleration_m_s2: Positive = 1.0
    """Rate at which the speed along the path may grow [m/s^2]; slowing is not limited by it."""
    restore_cycles: PositiveCount = 200
    """Control cycles l_max of eq. 4 until full speed after the cause of a reduction has gone (Table I, 100 Hz)."""
    position_gain_1_s: NonNegative = 2.0
    """Velocity towards the path per metre off it [1/s]."""
    off_path_m: Positive = 0.1
    """Distance from the path at which the arm no longer advances along it but only returns [m]."""
    orientation: Orientation = "hold"
    """free: the task is the hand's velocity alone. hold: it also keeps the orientation at the start. The paper does not
    specify this. A free hand rolls its units away from obstacles (docs/reference/experiments.md)."""
    orientation_gain_1_s: NonNegative = 1.0
    """Angular velocity per radian of orientation error with `hold` [1/s]."""
    damping_max: NonNegative = 0.1
    """Nakamura damping lambda_0, the factor mu of eq. 2 at a singularity (authors' code family)."""
    manipulability_threshold: Positive = 0.001
    """Manipulability w_0 below which damping begins (authors' code family)."""
    mid_joint_gain: Positive = 0.001
    """Weight k of the mid-joint term in eq. 2; larger values drag the arm off its path. It also keeps the
    Hessian positive definite."""
    mid_joint_projected: bool = False
    """True: the mid-joint term acts in the task's null space alone, where it does not disturb the task; the paper's
    acts on all joint velocities."""
    mid_joint_time_s: Positive = 5.0
    """Time t in which the mid-joint velocity would move the joints to their middle [s]."""
    control_period_s: Annotated[float, Check(low=1e-4, high=1.0)] = 0.01
    """Period of the controller [s] (paper: 100 Hz)."""
    position_margin_rad: NonNegative = 0.01
    """Distance of the commanded joint positions from the joint limits, at least [rad]."""


@dataclass(frozen=True)
class SpeedReduction(Checked):
    """Reduction of the end-effector's speed near obstacles (eq. 3). A silent unit slows it with and without this."""

    d_max_m: Positive = 0.8
    """Distance from the end-effector origin within which an obstacle slows the arm [m] (Table I)."""


RowKind = Literal["hard", "slack", "floor"]


@dataclass(frozen=True)
class RestrictionParams(Checked):
    """Restriction of the body's approach to obstacles (eqs. 5-7)."""

    rows: RowKind = "slack"
    """hard: rows as written, no slack. slack: a weighted slack for each row. floor: as slack, with the limit never
    below `floor_m_s`."""
    v_max_m_s: Positive = 0.04
    """Largest approach and largest repulsive velocity V_max [m/s] (Table I)."""
    beta: Negative = -10.0
    """Steepness of eqs. 5 and 6 (Table I); negative, so that nearer means slower."""
    d_repulse_m: Positive = 0.1
    """Body distance below which the arm is pushed away [m] (Table I)."""
    d_crit_m: Positive = 0.1
    """Body distance d_crit of eqs. 5 and 6 [m] (Table I)."""
    d_notice_m: Positive = 0.6
    """Body distance from which an approach is restricted [m] (Table I)."""
    floor_m_s: NonNegative = 0.02
    """Smallest approach limit with rows=floor, v_f [m/s]."""
    slack_weight: Positive = 1000.0
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_notice_m <= self.d_crit_m:
            raise ParameterError(
                f"{type(self).__name__}.d_notice_m is {self.d_notice_m}: it must be greater than d_crit_m,"
                f" {self.d_crit_m}."
            )


@dataclass(frozen=True)
class WindowParams(Checked):
    """The sliding window of the external force (eq. 8): the detection begins once it is full."""

    samples: Annotated[int, Check(low=2)] = 100
    """Samples in the sliding window at the control rate; not specified in the paper, 500 in the authors' code."""
    alpha: Fraction = 0.1
    """Weight of an outlier in the value that enters the window, eq. 8 (Table I)."""
    lambda_: NonNegative = 0.75
    """Standard deviations beyond which a sample is an outlier, eq. 8 (Table I)."""
    freeze_while_reacting: bool = False
    """True: the window does not change during a reaction, so that the push does not become its mean and the release a
    contact. False in the paper; without it a rebound towards the person in 10 of 15 releases (prototype)."""


@dataclass(frozen=True)
class ThresholdParams(Checked):
    """The contact thresholds, which move with the force's statistics and with obstacles (eqs. 9-11)."""

    f_base_n: Positive = 10.0
    """Base force F_b of a contact above the mean, eq. 9 [N] (Table I)."""
    f_std_n: NonNegative = 3.0
    """Largest addition F_std for a noisy signal, eq. 10 [N] (Table I)."""
    sigma_max_n: Positive = 3.0
    """Standard deviation at which that addition is largest, eq. 10 [N] (Table I)."""
    f_d_n: NonNegative = 4.0
    """Largest reduction F_d near an obstacle, eq. 11 [N] (Table I)."""
    d_max_m: Positive = 0.8
    """Distance from the end-effector origin at which the reduction begins, eq. 11 [m] (Table I)."""
    d_min_m: NonNegative = 0.05
    """Distance from the end-effector origin at which it is largest, eq. 11 [m] (Table I)."""
    compare: Literal["filtered", "raw"] = "filtered"
    """Force that is compared with the thresholds: the newest value in the window (paper) or the raw sample (the
    authors' code)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_max_m <= self.d_min_m:
            raise ParameterError(
                f"ThresholdParams.d_max_m is {self.d_max_m}: it must be greater than d_min_m, {self.d_min_m}."
            )
        if self.f_base_n <= self.f_d_n:
            raise ParameterError(
                f"ThresholdParams.f_base_n is {self.f_base_n}: it must be greater than f_d_n, {self.f_d_n}, or the"
                " thresholds could cross."
            )


@dataclass(frozen=True)
class FailureParams(Checked):
    """Limits of plausible inputs."""

    state_timeout_s: Annotated[float, Check(low=0.0, high=1.0, open_low=True)] = 0.05
    """Age of the robot state at which the arm holds [s]; commands are stored for the same time."""
    overrun_s: Positive = 0.05
    """Time between two steps from which the later one brakes [s]: a command is meant for one period."""
    force_max_n: Positive = 1e5
    """Wrench component from which an estimate is implausible [N, Nm]: far more than any arm survives. It would spoil
    the window's sums."""
    force_timeout_s: Positive = 0.2
    """Time without a force estimate after which the arm holds [s]."""
    desired_timeout_s: Positive = 0.1
    """Time after the last instant of a desired motion at which the arm comes to rest [s]: a few messages of a commander
    at 50 Hz may be late or lost."""
    solver_iterations: PositiveCount = 500
    """Iterations of the QP solver after which the arm brakes: a bound on its time that is the same in each replay. Most
    steps need fewer than 10."""


@dataclass(frozen=True)
class ClampParams(Checked):
    """Detection of a clamp between two objects while the arm yields, and the opening of the arm."""

    torque_nm: Positive = 4.0
    """Torque against the direction of yielding from which there is a clamp between two objects [Nm]: four times the
    noise of a Panda's estimate, about 8 N on the hand."""
    open_m_s: Positive = 0.1
    """Speed of the fastest point of the body while the arm opens back along its path [m/s]."""
    open_s: Positive = 0.5
    """Longest time of the opening [s]."""


@dataclass(frozen=True)
class PinchParams(Checked):
    """Detection of a pinch between two links, or a link and a fixture: the arm opens and holds.

    It needs the sequential detector; with fixtures, localisation too.
    """

    gap_m: Positive = 0.2
    """Largest gap of a pinch [m]: that of a thigh."""
    force_n: Positive = 30.0
    """Force from which there is a pinch [N]: a step of 2 Nm in one joint's estimate looks like 20 N with the lever of
    forearm and upper arm about the elbow. Less is a push, and opens the joint as well."""


@dataclass(frozen=True)
class GiveUpParams(Checked):
    """Giving up after repeated contacts with the same object."""

    contacts: PositiveCount = 3
    """Contacts at one location of the path after which the arm gives up."""
    push_j: Positive = 0.3
    """Energy from a contact to an arm at rest above which it is a push and does not count [J]: boards gave 0.05 J at
    most at touch speed, 0.5 J at 0.3 m/s unbraked, pushes of 15 to 30 N for 0.3 s at least 0.59 J
    (docs/explanation/reaction.md). For a moving arm, twice its kinetic energy is added."""
    retry_s: Positive = 30.0
    """Time after which the arm tries again if no unit saw an obstacle there [s]."""


@dataclass(frozen=True)
class AdmittanceParams(Checked):
    """A virtual mass and damper in each joint, driven by the external torque."""

    speed_max_m_s: Positive = 0.3
    """Bound on the speed of every point of the body's axes [m/s] (authors' code family, there of the hand)."""
    reach_m: Positive = 0.3
    """Largest displacement of any point of the body's axes by a contact [m]: that of the paper's reaction, so that the
    same room has to be free about the arm."""
    inertia_kg_m2: Positive = 1.5
    """Virtual inertia of each joint [kg m^2]: with the damping, 0.1 s to come to rest."""
    damping_nm_s: Positive = 15.0
    """Virtual damping of each joint [Nm s/rad]: 15 N on the hand at 0.5 m from the axis give about 0.2 m/s."""
    lag_s: NonNegative = 0.0167
    """Time constant of the robot's force estimate [s], 0 for none (a Panda's: about 10 Hz). With it, a force that has
    ended no longer drives the arm while its estimate decays."""
    dead_band_nm: NonNegative = 0.5
    """External torque of a joint that moves nothing [Nm]: friction of the smaller joints, unknown to the robot."""
    dead_band_fraction: NonNegative = 0.02
    """Addition to it as a fraction of the joint's torque limit: twice the noise of a Panda's larger joints."""
    static_friction_nm: NonNegative = 0.0
    """Filtered torque above which a joint at rest begins to move [Nm], 0 for none (3 in `pretouch`): a bias of 2 Nm and
    five deviations of a Panda's filtered noise. 15 N move the arm with a lever of 0.2 m."""
    start_energy_j: NonNegative = 0.2
    """Largest kinetic energy of the virtual mass at the beginning of a contact [J]."""
    quiet_s: Positive = 1.0
    """Time without a push after which the task continues [s]."""
    near_m: NonNegative = 0.1
    """Distance from the body within which an obstacle makes the arm wait, as a resting hand [m]."""
    patience_s: NonNegative = 10.0
    """Longest wait for that [s]."""
    soft_hold: bool = False
    """True: an arm in HOLD yields to a push where the cause of the HOLD allows it (`modes.TABLE`)."""
    clamp: ClampParams | None = None
    """Detection of a clamp between two objects while the arm yields; none: no detection."""
    pinch: PinchParams | None = None
    """Detection of a pinch between links, or a link and a fixture; none: each contact is a push."""
    give_up: GiveUpParams | None = None
    """Giving up after repeated contacts at a location; none: the arm never gives up."""
