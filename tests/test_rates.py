"""A profile at another rate: the same times, in other numbers of cycles."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.contact.window import Window, add_force, window_init
from pretouch.errors import ParameterError
from pretouch.profiles import PROFILES, Profile, at_rate

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
