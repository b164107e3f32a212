"""How early is early enough."""

import pytest

from pretouch.coverage.params import CoverageParams
from pretouch.sensing.sensor import PAPER_SENSOR


def test_the_warning_by_hand():
    # 0.8 m/s for 0.04 s and 0.02 s; 0.3^2 / 1.2 = 0.075 of the arm and 0.5 * 0.5 s of the object while it brakes
    p = CoverageParams()
    assert p.braking_m == pytest.approx(0.325)
    assert p.last_reading_m == pytest.approx(0.357)
    assert p.warning_m == pytest.approx(0.373)
    assert (p.first, p.run, p.last) == (36, 2, 80)


def test_steps_of_the_grid_are_not_lost_to_rounding():
    p = CoverageParams(object_speed_m_s=0.0, arm_speed_m_s=0.5, rate_hz=50.0, latency_s=0.1, deceleration_m_s2=0.5)
    assert p.last_reading_m == pytest.approx(0.3)
    assert (p.first, p.run) == (30, 1)


def test_what_stands_is_looked_for_on_twice_the_way_it_takes_to_stop():
    # 0.3 m/s for 0.04 and 0.02 s, and 0.075 m of braking
    standing = CoverageParams().standing()
    assert standing.warning_m == pytest.approx(0.093)
    assert (standing.first, standing.run, standing.last) == (9, 1, 18)
    # 50 mm fill a cone of 27 degrees up to 50 / tan 13.5
    assert standing.seen_by(PAPER_SENSOR)[0] == pytest.approx(0.2083, abs=1e-4)


@pytest.mark.parametrize("speed", [0.001, 0.05, 0.5])
def test_at_any_speed_that_way_is_long_enough_for_a_reading(speed):
    standing = CoverageParams(object_speed_m_s=0.0, arm_speed_m_s=speed).standing()
    assert standing.first + standing.run <= standing.last
