"""Numbers of a unit's health, from traffic that is made up."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from pretouch.units.health import Lateness, UnitWindow, unit_health
from pretouch.units.unit import UnitTraffic
from pretouch.units.wire import NO_TEMPERATURE, Flag
from tests.units.traffic import BEFORE, NOW, counts, heard, traffic


def health(samples, counted=None, **known):
    return unit_health(samples, NOW, traffic(**(counted or {}), **known), BEFORE)


def test_a_unit_that_is_well_has_the_numbers_it_was_given():
    unit = health(heard())
    assert unit.rate_hz == pytest.approx(50.0, rel=0.01)
    assert unit.loss == 0.0
    assert unit.latency_s == pytest.approx(0.015)
    assert unit.latency_late_s == pytest.approx(0.015)
    assert unit.silent_s == 0.0
    assert unit.sigma_m == pytest.approx(0.004)
    assert unit.battery_v == pytest.approx(3.9)
    assert unit.temperature_c == pytest.approx(31.0)
    assert unit.imu_rate_hz == pytest.approx(400.0)
    assert unit.imu_loss == 0.0
    assert unit.statuses == {"OK": 500}
    assert (unit.bus_errors, unit.restarts, unit.range_late, unit.reboots, unit.clock_jumps) == (0, 0, 0, 0, 0)


def test_late_looks_and_time_that_a_simulation_left_out_add_up_within_the_window():
    lateness = Lateness(every=0.1, length=10.0)
    for now in (5.0, 5.1, 5.24):  # by less than half of the time between two
        lateness.look(now)
    assert lateness.total == 0.0
    lateness.look(5.64)
    assert lateness.total == pytest.approx(0.3)
    lateness.look(5.74, left_out=0.5)
    lateness.look(5.84, left_out=0.5)
    assert lateness.total == pytest.approx(0.8)
    for k in range(1, 99):
        lateness.look(5.84 + 0.1 * k, left_out=0.5)
    lateness.look(15.69, left_out=0.5)
    assert lateness.total == pytest.approx(0.5)
    lateness.look(15.79, left_out=0.5)
    assert lateness.total == 0.0


def test_the_noise_is_that_of_the_readings_whatever_the_motion():
    rng = np.random.default_rng(5)
    still = health(heard(range_mm=lambda n: round(600 + rng.normal(scale=10.0))))
    moving = health(heard(range_mm=lambda n: round(100 + n % 500 * 1.6 + rng.normal(scale=10.0))))
    assert still.noise_m == pytest.approx(0.010, rel=0.15)
    assert moving.noise_m == pytest.approx(0.010, rel=0.15)


def test_samples_out_of_order_change_nothing():
    samples = heard()
    mixed = [*samples[:200], samples[201], samples[200], *samples[202:]]
    np.testing.assert_equal(asdict(health(mixed)), asdict(health(samples)))  # without touch a share is NaN


def test_what_a_unit_counts_begins_anew_with_a_reboot():
    before = heard(until=NOW - 4.0, seconds=6.0, bus_errors=60_000)
    after = heard(
        seconds=3.0, time_us=lambda n: 20_000 * (n - 29_000), imu_index=lambda n: 8 * (n - 29_000), bus_errors=2
    )
    unit = health([*before, *after], counts(450, 0, 1))
    assert unit.reboots == 1
    assert unit.bus_errors == 0
    assert unit.imu_rate_hz == pytest.approx(400.0)


def test_imu_samples_that_the_fifo_lost_are_told_from_those_of_lost_datagrams():
    lossy = [one for one in heard() if one.sample.sequence % 3]
    assert health(lossy).imu_loss == 0.0
    assert health(lossy).imu_rate_hz == pytest.approx(400.0)
    # two of ten are counted by the sensor and never sent
    unit = health(heard(imu_index=lambda n: 10 * n))
    assert unit.imu_rate_hz == pytest.approx(500.0)
    assert unit.imu_loss == pytest.approx(0.2, rel=0.02)


def test_the_longest_break_and_the_time_without_a_clock_are_told():
    unit = health([*heard(2.0, until=NOW - 8.0), *heard(2.0)])
    assert unit.gap_s == pytest.approx(6.02)
    assert unit.clock_unknown_s == 0.0
    known = heard(4.0, until=NOW - 3.0)
    unknown = [replace(one, bound=math.inf) for one in heard(3.0)]
    assert health([*known, *unknown], bound=math.inf).clock_unknown_s == pytest.approx(3.0)
    assert health(unknown, bound=math.inf).clock_unknown_s == pytest.approx(2.98)


def test_what_a_unit_cannot_tell_is_not_known():
    unit = health(heard(battery_mv=0, temperature_cdeg=NO_TEMPERATURE))
    assert math.isnan(unit.battery_v)
    assert math.isnan(unit.temperature_c)
    nothing = unit_health([], NOW, BEFORE, BEFORE)
    assert nothing.silent_s == math.inf
    assert math.isnan(nothing.rate_hz)
    assert nothing.statuses == {}


def test_a_window_forgets_what_is_older_than_it():
    window, told = UnitWindow(10.0), UnitTraffic("hand-1", 7)
    samples = heard(30.0)
    for step in range(30):
        now = NOW - 29.0 + step
        told.accepted, told.lost = 50 * (step + 1), 10 * min(step, 5)
        told.last_arrival = now
        window.take(now, samples[50 * step : 50 * (step + 1)], told)
    unit = window.health(NOW, told)
    assert sum(unit.statuses.values()) == 500
    assert unit.loss == 0.0  # those lost were lost 24 s ago
    assert unit.heard_s == pytest.approx(10.0, abs=0.03)


def test_flags_of_a_sample_are_counted():
    late, anew = Flag.RANGE_NEW | Flag.RANGE_LATE, Flag.RANGE_NEW | Flag.IMU_RESTARTED
    unit = health(heard(flags=lambda n: int(late if n % 100 == 0 else anew if n % 100 == 1 else Flag.RANGE_NEW)))
    assert unit.range_late == 5
    assert unit.restarts == 5


def test_bus_errors_are_told_after_their_count_has_ended():
    failing = int(Flag.RANGE_NEW | Flag.IMU_BUS_ERROR)
    unit = health(heard(bus_errors=65_535, flags=lambda n: failing if n % 50 == 0 else int(Flag.RANGE_NEW)))
    assert unit.bus_errors == 10
