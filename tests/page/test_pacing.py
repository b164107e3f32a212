from itertools import pairwise

import pytest

from pretouch.page.pacing import Pace

PERIOD = 1 / 30


def run(pace: Pace, start: float, seconds: float, period: float, speed: float = 1.0) -> float:
    """Tick every `period` [s], each time 1/30 s of the speed being simulated; return the time after."""
    for _ in range(round(seconds / period)):
        start += period
        pace.tick(start, speed * PERIOD, speed)
    return start


@pytest.mark.parametrize("speed", [1.0, 0.1])
def test_a_machine_that_keeps_up_runs_at_real_time_and_says_nothing_in_slow_motion_too(speed: float) -> None:
    pace = Pace()
    run(pace, 0.0, 10.0, PERIOD, speed=speed)
    assert pace.factor == pytest.approx(speed, rel=1e-6)
    assert pace.updates == pytest.approx(30.0, rel=1e-6)
    assert not pace.slow
    assert pace.sentence() == ""


def test_a_slow_machine_is_named_after_a_while_and_the_share_is_right() -> None:
    pace = Pace()
    now = run(pace, 0.0, 1.5, 2 * PERIOD)
    assert not pace.slow
    run(pace, now, 4.0, 2 * PERIOD)
    assert pace.slow
    assert "50 %" in pace.sentence()
    assert "with the same physics" in pace.sentence()


def test_a_hiccup_is_not_slowness() -> None:
    pace = Pace()
    now = run(pace, 0.0, 5.0, PERIOD)
    pace.tick(now + 0.5, PERIOD, 1.0)
    run(pace, now + 0.5, 5.0, PERIOD)
    assert not pace.slow


def test_what_is_said_does_not_flap_at_the_limit() -> None:
    pace, now, said = Pace(), 0.0, []
    for turn in range(60):
        now = run(pace, now, 0.5, PERIOD * (1.15 if turn % 2 else 1.08))
        said.append(pace.slow)
    assert sum(a != b for a, b in pairwise(said)) <= 1


def test_a_machine_that_keeps_up_again_is_believed_after_a_while() -> None:
    pace = Pace()
    now = run(pace, 0.0, 6.0, 2 * PERIOD)
    now = run(pace, now, 2.0, PERIOD)
    assert pace.slow
    assert "100 %" not in pace.sentence()
    run(pace, now, 3.0, PERIOD)
    assert not pace.slow


def test_a_pause_is_no_slowness_and_forgets_it() -> None:
    pace = Pace()
    now = run(pace, 0.0, 6.0, 2 * PERIOD)
    assert pace.slow
    pace.tick(now + PERIOD, 0.0, 0.0)
    assert not pace.slow
    run(pace, now + 60.0, 1.2, PERIOD)
    assert pace.factor == pytest.approx(1.0, rel=0.01)
