"""Every parameter of the controller: value, unit, meaning, source. Table I of the paper gives the defaults.

A profile is a frozen set of them. `replace(profile, ...)` of the standard library makes a variant, checked again.
"""

import math
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, Fraction, Negative, NonNegative, Positive, PositiveCount
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class PerceptionParams(Checked):
    """From readings to obstacle points (eq. 1)."""

    enabled: bool = True
    """Whether proximity is used at all; `blind` switches it off."""
    filter_views: bool = True
    """Whether readings that show the arm itself or a fixture are left out; off, they count as obstacles."""
    persistence_s: Positive = 0.06
    """How long a sensed point is kept after the measurement that showed it [s]: two missed readings at 50 Hz."""
    self_margin_m: NonNegative = 0.06
    """A reading is taken as the arm or a fixture from this much before its predicted return [m]: twice the
    VL53L1X ranging error of 25 mm, and 10 mm of pose error."""
    spread_sigmas: NonNegative = 2.0
    """Standard deviations of a unit's place by which what it shows counts as nearer, and as the arm or a fixture
    earlier [1]: ours, about 95 % along one direction. It has no effect where the skin says no uncertainty."""
    slow_after_s: Positive = 0.1
    """Age of a unit's newest telling reading at which the arm begins to slow [s]."""
    silent_after_s: Positive = 0.3
    """Age of a unit's newest telling reading at which it counts as silent and the arm holds [s]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.slow_after_s >= self.silent_after_s:
            raise ParameterError(
                f"PerceptionParams.slow_after_s is {self.slow_after_s}: it must be less than silent_after_s,"
                f" {self.silent_after_s}."
            )


Orientation = Literal["free", "hold"]


@dataclass(frozen=True)
class TaskParams(Checked):
    """Following the path, and the cost of the QP (eq. 2)."""

    speed_m_s: Positive = 0.3
    """Largest end-effector speed along the path [m/s] (paper, IV-A)."""
    acceleration_m_s2: Positive = 1.0
    """Rate at which the speed along the path may grow [m/s^2]; slowing is not limited by it."""
    position_gain_1_s: NonNegative = 2.0
    """Velocity towards the path per metre off it [1/s]."""
    off_path_m: Positive = 0.1
    """Distance from the path at which the arm no longer advances along it but only returns [m]."""
    orientation: Orientation = "hold"
    """Whether the task is the hand's velocity alone, or also keeps its orientation at the start. The paper does not
    say. Free, the hand rolls its units out of view of what restricts it (docs/experiments.md)."""
    orientation_gain_1_s: NonNegative = 1.0
    """Angular velocity per radian of orientation error when it is held [1/s]."""
    damping_max: NonNegative = 0.1
    """Nakamura damping lambda_0, the factor mu of eq. 2 at a singularity (authors' code family)."""
    manipulability_threshold: Positive = 0.001
    """Manipulability w_0 below which damping begins (authors' code family)."""
    mid_joint_gain: Positive = 0.001
    """Weight k of the mid-joint term in eq. 2; larger values drag the arm off its path. It also keeps the
    Hessian positive definite."""
    mid_joint_time_s: Positive = 5.0
    """Time t in which the mid-joint velocity would bring the joints to their middle [s]."""
    control_period_s: Annotated[float, Check(low=1e-4, high=1.0)] = 0.01
    """Period of the controller [s] (paper: 100 Hz)."""
    position_margin_rad: NonNegative = 0.01
    """Distance the commanded joint positions keep from the joint limits [rad]."""


@dataclass(frozen=True)
class ReductionParams(Checked):
    """Slowing the end-effector (eqs. 3-4)."""

    enabled: bool = True
    """Whether what is near slows the arm. A unit that falls silent slows it in any case."""
    d_max_m: Positive = 0.8
    """Distance from the end-effector origin within which an obstacle slows the arm [m] (Table I)."""
    l_max_cycles: PositiveCount = 200
    """Control cycles until full speed is restored after the obstacle vanished (Table I, at 100 Hz)."""


RestrictionMode = Literal["off", "hard", "slack", "floor"]


@dataclass(frozen=True)
class RestrictionParams(Checked):
    """Restricting the body's approach to obstacles (eqs. 5-7)."""

    mode: RestrictionMode = "slack"
    """off: no rows. hard: rows as written, no slack. slack: a weighted slack for each row. floor: as slack, with
    the limit never below `floor_m_s`."""
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
    """Smallest approach limit in mode floor, v_f [m/s]."""
    slack_weight: Positive = 1000.0
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.d_notice_m <= self.d_crit_m:
            raise ParameterError(
                f"RestrictionParams.d_notice_m is {self.d_notice_m}: it must be greater than d_crit_m, {self.d_crit_m}."
            )


@dataclass(frozen=True)
class ThresholdParams(Checked):
    """The force window and the contact thresholds (eqs. 8-11)."""

    window_samples: Annotated[int, Check(low=2)] = 100
    """Samples in the sliding window at the control rate; the paper does not say, the authors' code has 500."""
    alpha: Fraction = 0.1
    """Influence of an outlier on the value that enters the window, eq. 8 (Table I)."""
    lambda_: NonNegative = 0.75
    """Standard deviations beyond which a sample is an outlier, eq. 8 (Table I)."""
    f_base_n: Positive = 10.0
    """Base force F_b above the mean that makes a contact, eq. 9 [N] (Table I)."""
    f_std_n: NonNegative = 3.0
    """Largest addition F_std for a noisy signal, eq. 10 [N] (Table I)."""
    sigma_max_n: Positive = 3.0
    """Standard deviation at which that addition is full, eq. 10 [N] (Table I)."""
    f_d_n: NonNegative = 4.0
    """Largest reduction F_d near an obstacle, eq. 11 [N] (Table I)."""
    d_max_m: Positive = 0.8
    """Distance from the end-effector origin at which the reduction begins, eq. 11 [m] (Table I)."""
    d_min_m: NonNegative = 0.05
    """Distance from the end-effector origin at which it is full, eq. 11 [m] (Table I)."""
    compare: Literal["filtered", "raw"] = "filtered"
    """Which force is held against the thresholds: the newest value in the window (paper) or the raw sample
    (the authors' code)."""

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
class ReactionParams(Checked):
    """Moving with the push (eq. 12)."""

    compliance_m_s_n: Positive = 0.03
    """Diagonal of the compliance matrix C [(m/s)/N] (authors' code family)."""
    speed_max_m_s: Positive = 0.3
    """Bound on the norm of the reaction velocity [m/s] (authors' code family, there per axis)."""
    decay_cycles: PositiveCount = 200
    """Control cycles in which the reaction decays linearly to zero. Shorter than the window, the release of a
    push is taken for a new contact."""


@dataclass(frozen=True)
class FailureParams(Checked):
    """When to stop trusting the inputs."""

    state_timeout_s: Positive = 0.05
    """Age of the robot state at which the arm holds [s]."""
    overrun_s: Positive = 0.05
    """Time between two steps from which the later one brakes [s]: a command is meant to be held for one period."""
    force_max_n: Positive = 1e5
    """Wrench component from which an estimate is no estimate [N, Nm]: far more than any arm survives. Let in, it would
    spoil the window's sums."""
    force_timeout_s: Positive = 0.2
    """Time without a force estimate after which the arm holds [s]."""
    solver_iterations: PositiveCount = 500
    """Iterations of the QP solver after which the arm brakes. A bound on its time that is the same in each replay; most
    steps need less than 10."""


@dataclass(frozen=True)
class Profile(Checked):
    """A named set of parameters for the whole controller."""

    name: str = "paper"
    """Name shown in tables and files."""
    perception: PerceptionParams = field(default_factory=PerceptionParams)
    task: TaskParams = field(default_factory=TaskParams)
    reduction: ReductionParams = field(default_factory=ReductionParams)
    restriction: RestrictionParams = field(default_factory=RestrictionParams)
    threshold: ThresholdParams = field(default_factory=ThresholdParams)
    reaction: ReactionParams = field(default_factory=ReactionParams)
    failure: FailureParams = field(default_factory=FailureParams)


_PAPER = Profile()

PROFILES: dict[str, Profile] = {
    "paper": _PAPER,
    "blind": Profile(
        name="blind",
        perception=PerceptionParams(enabled=False),
        restriction=RestrictionParams(mode="off"),
    ),
    "slowing-only": replace(_PAPER, name="slowing-only", threshold=ThresholdParams(f_d_n=0.0)),
    "thresholds-only": replace(_PAPER, name="thresholds-only", reduction=ReductionParams(enabled=False)),
    "paper-0.5m": replace(
        _PAPER,
        name="paper-0.5m",
        reduction=ReductionParams(d_max_m=0.5),
        restriction=RestrictionParams(d_notice_m=0.5),
        threshold=ThresholdParams(d_max_m=0.5),
    ),
}
"""`paper`: the equations and Table I. `blind`: the same without proximity, eqs. 8-10 with F_obs = 0.
`slowing-only` and `thresholds-only`: the paper's ablations, one use of proximity each (restrictions are apart from
both). `paper-0.5m`: in place of Table I's distances the 0.5 m within which obstacles affect the arm by the paper's
text (section V-C)."""


def profile(name: str) -> Profile:
    """Look a profile up: by its name, or as `NAME:GROUP.FIELD=VALUE:...`, that profile with some parameters changed.

    `paper:threshold.window_samples=500:reduction.enabled=no`, for example. Raises ParameterError for a profile, group
    or field there is not, naming those there are, and for a value the field does not allow.
    """
    base, *changes = name.split(":")
    try:
        found = PROFILES[base]
    except KeyError:
        raise ParameterError(f"The profile {base!r} is unknown: choose from {', '.join(PROFILES)}.") from None
    values: dict[str, dict[str, object]] = {}
    for change in changes:
        group, field_name, value = _change(found, change)
        values.setdefault(group, {})[field_name] = value
    # all of a group at once, for some are only allowed together
    return replace(found, name=name, **{g: replace(getattr(found, g), **changed) for g, changed in values.items()})


def _change(profile: Profile, change: str) -> tuple[str, str, object]:
    """Read the change of one parameter, given as GROUP.FIELD=VALUE: its group, its name and its value."""
    where, given, text = change.partition("=")
    group, _, name = where.partition(".")
    if not given:
        raise ParameterError(f"The change {change!r} has no value: write GROUP.FIELD=VALUE.")
    groups = [f.name for f in fields(Profile) if f.name != "name"]
    if group not in groups:
        raise ParameterError(f"The group {group!r} of {change!r} is unknown: choose from {', '.join(groups)}.")
    params = getattr(profile, group)
    known = [f.name for f in fields(params)]
    if name not in known:
        raise ParameterError(f"The parameter {where!r} is unknown: choose from {', '.join(known)}.")
    return group, name, _read(where, text, getattr(params, name))


def at_rate(profile: Profile, rate: float) -> Profile:
    """Return a profile for a controller at another rate [Hz]: what it counts in cycles lasts as long as before.

    That is the fading of eq. 4, the force window, and the decay of a reaction; alpha of eq. 8, the weight of one
    sample, changes so that a lasting push enters the window as fast as before.
    """
    p, more = profile, rate * profile.task.control_period_s
    if not (math.isfinite(rate) and rate * p.failure.overrun_s > 1):
        least = 1 / p.failure.overrun_s
        raise ParameterError(f"The rate is {rate:g} Hz: it must be more than {least:g} Hz, or each step would be late.")
    samples, alpha = max(2, round(p.threshold.window_samples * more)), 1 - (1 - p.threshold.alpha) ** (1 / more)
    return p if more == 1 else replace(
        p,
        task=replace(p.task, control_period_s=1 / rate),
        reduction=replace(p.reduction, l_max_cycles=max(1, round(p.reduction.l_max_cycles * more))),
        threshold=replace(p.threshold, window_samples=samples, alpha=alpha),
        reaction=replace(p.reaction, decay_cycles=max(1, round(p.reaction.decay_cycles * more))),
    )  # fmt: skip


_WORDS = {"yes": True, "true": True, "no": False, "false": False}


def _read(where: str, text: str, now: object) -> object:
    """Read a value of the kind the parameter has now."""
    if isinstance(now, bool):
        if text not in _WORDS:
            raise ParameterError(f"{where} is {text!r}: write yes or no.")
        return _WORDS[text]
    if not isinstance(now, Real):
        return text
    try:
        return int(text) if isinstance(now, Integral) else float(text)
    except ValueError:
        kind = "a whole number" if isinstance(now, Integral) else "a number"
        raise ParameterError(f"{where} is {text!r}: write {kind}.") from None
