"""Table I, and that no bad value gets past the parameters."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from pretouch.contact.admittance import Admittance
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import DecayingVelocity
from pretouch.contact.window import Window, add_force, window_init
from pretouch.control.approach import ApproachRestriction, BrakingCurve
from pretouch.errors import ParameterError, PretouchError
from pretouch.params import (
    ClampParams,
    FailureParams,
    GiveUpParams,
    LocalMapParams,
    OutsidePoints,
    PerceptionParams,
    PinchParams,
    RestrictionParams,
    SpeedReduction,
    TaskParams,
    ThresholdParams,
    WindowParams,
)
from pretouch.profiles import PROFILES, Profile, at_rate, profile
from pretouch.sim.plant_params import PlantParams

SETS = [
    PerceptionParams(), OutsidePoints(), LocalMapParams(), TaskParams(), SpeedReduction(), RestrictionParams(),
    ThresholdParams(), FailureParams(),
    DecayingVelocity(), Admittance(), ClampParams(), PinchParams(), GiveUpParams(),
]  # fmt: skip
NUMBERS = [
    (s, f.name)
    for s in SETS
    for f in fields(s)
    if isinstance(getattr(s, f.name), int | float) and not isinstance(getattr(s, f.name), bool)
]
CHOICES = [(s, f.name) for s in SETS for f in fields(s) if isinstance(getattr(s, f.name), str)]
COUNTS = [(s, name) for s, name in NUMBERS if isinstance(getattr(s, name), int)]


def name_of(value: object) -> str:
    return value if isinstance(value, str) else type(value).__name__


def test_the_paper_profile_is_table_i():
    p = profile("paper")
    # d_max appears in eqs. 3, 4 and in eq. 11
    assert (p.slow.d_max_m, p.detect.d_max_m) == (0.8, 0.8)
    assert p.detect.d_min_m == 0.05
    # 200 cycles at 100 Hz
    assert (p.task.restore_cycles, p.task.control_period_s) == (200, 0.01)
    assert p.approach.v_max_m_s == 0.04
    assert p.approach.d_repulse_m == 0.1
    assert p.approach.d_crit_m == 0.1
    assert p.approach.d_notice_m == 0.6
    assert p.window.alpha == 0.1
    assert p.approach.beta == -10
    assert p.window.lambda_ == 0.75
    assert p.detect.f_std_n == 3
    assert p.detect.f_d_n == 4
    assert p.detect.f_base_n == 10
    assert p.detect.sigma_max_n == 3
    # IV-A: trajectories at 0.3 m/s
    assert p.task.speed_m_s == 0.3


def test_each_profile_is_found_by_its_own_name():
    assert {name: p.name for name, p in PROFILES.items()} == {name: name for name in PROFILES}


MAY_BE_NONE = {"self_margin_m"}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, None, "fast"])
@pytest.mark.parametrize(("params", "name"), NUMBERS, ids=name_of)
def test_every_number_must_be_a_finite_number(params: object, name: str, value: object):
    if value is None and name in MAY_BE_NONE:
        assert getattr(replace(params, **{name: None}), name) is None
        return
    with pytest.raises(ParameterError, match=rf"{type(params).__name__}\.{name} is {value}: it must be "):
        replace(params, **{name: value})


@pytest.mark.parametrize(("params", "name"), [n for n in NUMBERS if n[1] != "beta"], ids=name_of)
def test_no_number_but_beta_may_be_negative(params: object, name: str):
    with pytest.raises(ParameterError, match=name):
        replace(params, **{name: -1})


@pytest.mark.parametrize(("params", "name"), COUNTS, ids=name_of)
def test_counts_are_whole_and_not_zero(params: object, name: str):
    for value in (0, 100.5):
        with pytest.raises(ParameterError, match=name):
            replace(params, **{name: value})


@pytest.mark.parametrize(("params", "name"), CHOICES, ids=name_of)
def test_choices_are_listed_when_refused(params: object, name: str):
    with pytest.raises(ParameterError, match=r"is 'sideways': choose one of .*" + str(getattr(params, name))):
        replace(params, **{name: "sideways"})


@pytest.mark.parametrize(
    ("params", "change", "said"),
    [
        (PerceptionParams(), {"slow_after_s": 0.3}, "silent_after_s"),
        (OutsidePoints(), {"slow_after_s": 0.4}, "silent_after_s"),
        (PerceptionParams(), {"outside": OutsidePoints()}, "outside is set without a memory"),
        (RestrictionParams(), {"d_notice_m": 0.1}, "d_crit_m"),
        (ThresholdParams(), {"d_max_m": 0.05}, "d_min_m"),
        (ThresholdParams(), {"f_base_n": 4.0}, "f_d_n"),
        (WindowParams(alpha=1.0), {"alpha": 1.1}, r"alpha is 1\.1: it must be at most 1"),
        (FailureParams(state_timeout_s=1.0), {"state_timeout_s": 1e6}, r"_s is 1000000\.0: it must be at most 1"),
        (TaskParams(), {"speed_m_s": 10**400}, r"speed_m_s is 10{400}: it must be finite"),
        (PlantParams(), {"friction_f1_nm": (10**400,) * 7}, "give finite numbers"),
    ],
    ids=name_of,
)
def test_values_that_contradict_others_or_are_too_large_are_refused(params: object, change: dict, said: str):
    with pytest.raises(ParameterError, match=said):
        replace(params, **change)


def test_a_bad_value_is_a_value_error_and_one_of_ours():
    with pytest.raises(ValueError, match="speed_m_s") as caught:
        TaskParams(speed_m_s=0.0)
    assert isinstance(caught.value, PretouchError)


def test_blind_is_the_paper_without_proximity_and_ablations_take_one_use_of_it_away():
    paper, blind = profile("paper"), profile("blind")
    assert blind.perception is None
    assert blind.approach is None
    assert replace(blind, name="paper", perception=paper.perception, approach=paper.approach) == paper
    slowing, moving = profile("slowing-only"), profile("thresholds-only")
    assert slowing.detect.f_d_n == 0.0
    assert replace(slowing, name="paper", detect=paper.detect) == paper
    assert moving.slow is None
    assert replace(moving, name="paper", slow=paper.slow) == paper


def test_a_profile_is_varied_by_its_name():
    name = "paper:window.samples=500:slow=none:detect.compare=raw:approach.beta=-20"
    varied = profile(name)
    assert varied.name == name
    assert varied.window == WindowParams(samples=500)
    assert varied.detect == MovingThresholds(compare="raw")
    assert varied.slow is None
    assert varied.approach == ApproachRestriction(beta=-20.0)
    assert varied.task == profile("paper").task


@pytest.mark.parametrize(("value", "problem"), [(-1.0, "at least 0"), (math.nan, "finite"), ("fast", "a number")])
def test_a_value_that_may_be_none_is_checked_if_it_is_not(value: object, problem: str):
    assert BrakingCurve(closing_deadband_m_s=None).closing_deadband_m_s is None
    with pytest.raises(ParameterError, match=rf"BrakingCurve.closing_deadband_m_s is {value}: it must be {problem}"):
        BrakingCurve(closing_deadband_m_s=value)  # type: ignore[arg-type]


def test_the_order_of_changes_does_not_matter():
    one = profile("paper:detect.f_base_n=3:detect.f_d_n=2")
    other = profile("paper:detect.f_d_n=2:detect.f_base_n=3")
    assert one.detect == other.detect == MovingThresholds(f_base_n=3.0, f_d_n=2.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("papre:task.speed_m_s=0.1", "The profile 'papre' is unknown: choose from paper, blind"),
        ("paper:speed=0.1", "The group 'speed' of 'speed=0.1' is unknown: choose from perception, task, slow,"),
        ("paper:task.sped=0.1", "The parameter 'task.sped' is unknown: choose from speed_m_s,"),
        ("paper:task.speed_m_s", "has no value: write PATH=VALUE"),
        ("paper:", "has no value"),
        ("paper:name=x", "The group 'name' of 'name=x' is unknown"),
        ("paper:task.speed_m_s=fast", "task.speed_m_s is 'fast': write a number"),
        ("paper:task.speed_m_s=-1", "TaskParams.speed_m_s is -1.0: it must be greater than 0"),
        ("paper:window.samples=10.5", "window.samples is '10.5': write a whole number"),
        ("paper:slow=0", "slow is '0': write on or none"),
        ("paper:approach.rows=firm", "ApproachRestriction.rows is 'firm': choose one of hard, slack, floor"),
        ("paper:detect.d_max_m=nan", "MovingThresholds.d_max_m is nan: it must be finite"),
        ("paper:detect=magic", "There is no Detector called 'magic': choose from .*sequential"),
        ("paper:detect.touch=on", "The parameter 'detect.touch' is unknown: choose from f_base_n"),
        ("pretouch:react.soft_hold=maybe", "react.soft_hold is 'maybe': write yes or no"),
        ("pretouch:detect.localise=none:detect.localise.force_n=3", "detect.localise is none: choose it first"),
    ],
)
def test_a_variation_that_cannot_be_is_refused(name, words):
    with pytest.raises(ParameterError, match=words):
        profile(name)


# a profile at another rate: the same times, in other numbers of cycles


PAPER = PROFILES["paper"]


@pytest.mark.parametrize("rate", [50.0, 250.0, 1000.0])
def test_what_is_counted_in_cycles_lasts_as_long(rate: float):
    fast = at_rate(PAPER, rate)
    assert fast.task.control_period_s == pytest.approx(1 / rate)
    for counted in (
        lambda p: p.task.restore_cycles, lambda p: p.window.samples, lambda p: p.react.decay_cycles,
    ):  # fmt: skip
        assert counted(fast) * fast.task.control_period_s == pytest.approx(counted(PAPER) * 0.01)


def test_all_else_stays():
    fast = at_rate(PAPER, 1000.0)
    back = replace(
        fast,
        task=replace(fast.task, control_period_s=0.01, restore_cycles=200),
        window=replace(fast.window, samples=100, alpha=0.1),
        react=replace(fast.react, decay_cycles=200),
    )
    assert back == PAPER
    assert at_rate(PAPER, 100.0) == PAPER


def pushed(profile: Profile, seconds: float, force: float = 100.0) -> float:
    """The newest value in a window that was filled with no force, after a push of `seconds` [N]."""
    p = profile.window
    window: Window = window_init(p.samples)
    for _ in range(p.samples):
        window = add_force(window, np.zeros(3), p)
    for _ in range(round(seconds / profile.task.control_period_s)):
        window = add_force(window, np.full(3, force), p)
    return float(window.newest[0])


def test_a_push_enters_the_window_as_fast():
    assert 20 < pushed(PAPER, 0.05) < 60
    assert pushed(at_rate(PAPER, 1000.0), 0.05) == pytest.approx(pushed(PAPER, 0.05), rel=0.02)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_weights_at_the_ends_of_their_range_stay(alpha: float):
    profile = replace(PAPER, window=replace(PAPER.window, alpha=alpha))
    assert at_rate(profile, 1000.0).window.alpha == alpha


def test_counts_stay_whole_and_large_enough():
    few = replace(
        PAPER,
        task=replace(PAPER.task, restore_cycles=1),
        window=replace(PAPER.window, samples=2),
        react=replace(PAPER.react, decay_cycles=1),
    )
    slow = at_rate(few, 25.0)
    assert (slow.task.restore_cycles, slow.window.samples, slow.react.decay_cycles) == (1, 2, 1)


@pytest.mark.parametrize("rate", [20.0, 0.0, -1000.0, float("nan"), float("inf")])
def test_a_rate_at_which_every_step_would_be_late_is_refused(rate: float):
    with pytest.raises(ParameterError, match=r"it must be more than 20 Hz"):
        at_rate(PAPER, rate)
