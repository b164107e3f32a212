"""The loop of a unit on sensors that are well, slow, wrong, away and back."""

import os
import sys

import fake_vl53l5cx
from fake_receiver import steps
from fake_unit import FakeUnit

os.chdir(sys.path[0])
NEW, RANGE_ERROR, IMU_ERROR, IMU_LOST, RANGE_RESTARTED, IMU_RESTARTED, LATE = 1, 2, 4, 8, 16, 32, 64
SECOND = 1_000_000


def _well(start_us=0):
    """A unit that has run for a second."""
    unit = FakeUnit(start_us)
    unit.run(SECOND)
    return unit


def _all_flags(samples):
    flags = 0
    for sample in samples:
        flags |= sample["flags"]
    return flags


def _gaps(samples):
    return steps([s["time_us"] for s in samples])


def a_unit_that_is_well_says_each_range_as_soon_as_it_is_there_and_400_imu_samples_a_second():
    unit = _well()
    unit.battery_mv = 3700
    samples = unit.run(4 * SECOND)
    assert 196 <= len(samples) <= 202, len(samples)
    assert all(s["flags"] == NEW for s in samples)
    ages = [s["age"] for s in samples]
    assert 7_500 <= min(ages) <= max(ages) < 13_000, "half of the budget, a pass, and 3 ms of the bus"
    assert [s["sequence"] for s in samples] == list(range(samples[0]["sequence"], samples[-1]["sequence"] + 1))
    assert {(s["mm"], s["status"], s["sigma"], s["signal"], s["ambient"], s["spads"]) for s in samples} == {
        (500, 0, 10, 3000, 100, 40 << 8)
    }
    assert set(steps([s["stream"] for s in samples])) <= {1, 2, -127, -126}, "from 255 it goes on with 128"
    assert sum(s["count"] for s in samples) >= 1600
    index = samples[0]["index"]
    for sample in samples:
        assert sample["index"] == index
        index += sample["count"]
    assert {s["rate"] for s in samples} == {416}
    assert all(0 < s["imu_age"] < 5_000 for s in samples)
    assert (samples[-1]["battery"], samples[-1]["temperature"]) == (3700, 2500)


def a_range_is_told_as_old_as_it_is_or_a_little_older():
    unit = _well()
    middles = {}

    def note():
        middles[unit.range_finder._stream] = unit.range_finder.middle_us

    samples = unit.run(2 * SECOND, note)[2:]
    older = [middles[s["stream"]] - (s["time_us"] - s["age"]) for s in samples if s["flags"] & NEW]
    assert len(older) > 90
    assert -200 <= min(older) <= max(older) <= 6_000, (min(older), max(older))


def a_dead_range_finder_does_not_stop_the_imu_and_its_last_range_grows_old():
    unit = _well()
    unit.range_finder.power_off()
    unit.run(SECOND)
    samples = unit.run(2 * SECOND)
    assert 78 <= len(samples) <= 80, len(samples)
    assert min(_gaps(samples)) >= 25_000
    assert all(s["flags"] & (RANGE_ERROR | LATE | NEW) == RANGE_ERROR | LATE for s in samples)
    assert sum(s["count"] for s in samples) >= 800
    assert samples[-1]["bus_errors"] > samples[0]["bus_errors"] >= 3
    samples = unit.run(17 * SECOND, pass_us=15_000)
    old = [s for s in samples if not s["flags"] & NEW and s["status"] == 0]
    assert 9 * SECOND < old[-1]["age"] < 10 * SECOND
    assert (samples[-1]["status"], samples[-1]["age"]) == (255, 0xFFFFFFFF)
    before = unit.errors.errors
    unit.run(20 * SECOND, pass_us=15_000)
    assert 3 <= unit.errors.errors - before <= 5, "attempts become rare"


def lost_power_is_found_even_if_it_was_a_blink_and_both_are_begun_anew():
    for away_us in (0, SECOND):
        unit = _well()
        unit.range_finder.power_off()
        unit.lsm6ds3.power_off()
        unit.run(away_us)
        unit.range_finder.power_on()
        unit.lsm6ds3.power_on()
        flags = _all_flags(unit.run(SECOND + 2 * away_us))
        assert flags & (RANGE_RESTARTED | IMU_RESTARTED) == RANGE_RESTARTED | IMU_RESTARTED, flags
        assert _all_flags(unit.run(SECOND)) == NEW


def ranges_that_come_too_fast_wait_for_10_ms_to_pass():
    unit = _well()
    take = unit.unit._range_finder.step

    def step(now):
        take(now)
        unit.unit._range_finder.new = True

    unit.unit._range_finder.step = step
    samples = unit.run(SECOND)
    assert 90 <= len(samples) <= 100, len(samples)


def a_dead_imu_does_not_stop_the_range_finder_and_once_back_counts_what_is_missing():
    unit = _well()
    unit.lsm6ds3.power_off()
    unit.run(SECOND)
    samples = unit.run(2 * SECOND)
    assert 98 <= len(samples) <= 102
    assert all(s["flags"] & IMU_ERROR and s["count"] == 0 and s["imu_age"] == 0xFFFFFFFF for s in samples)
    assert sum(s["flags"] & NEW for s in samples) >= 94
    unit.lsm6ds3.power_on()
    samples = unit.run(4 * SECOND)
    assert _all_flags(samples) & IMU_LOST
    for sample in samples:
        if sample["count"]:
            assert abs(sample["index"] - sample["time_us"] * 416e-6) < 60, sample


def an_overrun_is_told_and_counted():
    unit = _well()
    before = unit.run(SECOND)[-1]
    unit.now.advance(1_900_000)
    after = unit.run(SECOND)
    assert _all_flags(after) & IMU_LOST, "its FIFO holds less than 1.7 s"
    elapsed = after[-1]["time_us"] - before["time_us"]
    assert abs(after[-1]["index"] - before["index"] - elapsed * 416e-6) < 40


def after_a_late_pass_a_backlog_is_told_in_parts_with_its_age_and_no_sample_is_made_up_for():
    unit = _well()
    before = unit.run(SECOND)
    unit.now.advance(400_000)
    samples = unit.run(SECOND)
    assert 49 <= len(samples) <= 51, len(samples)
    assert min(_gaps(samples)) >= 9_000, _gaps(samples)
    assert samples[0]["sequence"] == before[-1]["sequence"] + 1
    assert samples[0]["count"] == 32
    assert samples[0]["imu_age"] > 300_000
    assert samples[-1]["count"] < 12
    assert samples[-1]["imu_age"] < 5_000
    assert not _all_flags(samples) & IMU_LOST


def a_few_errors_on_the_bus_are_told_up_to_65535_and_nothing_is_begun_anew():
    unit = _well()
    before = unit.errors.errors
    unit.bus.fail_next(2)
    samples = unit.run(SECOND)
    flags = _all_flags(samples)
    assert flags & (RANGE_ERROR | IMU_ERROR)
    assert not flags & (RANGE_RESTARTED | IMU_RESTARTED)
    assert samples[-1]["bus_errors"] - before == 2
    unit.errors.errors = 65534
    unit.bus.fail_next(5)
    assert unit.run(SECOND)[-1]["bus_errors"] == 65535


def a_stuck_bus_and_a_held_data_line_give_nothing_and_samples_go_on():
    for level in (None, 0x00, 0xFF):
        unit = _well()
        unit.bus.stuck = level is None
        unit.bus.held = None if level is None else lambda level=level: level
        unit.run(SECOND)
        samples = unit.run(2 * SECOND)
        assert (78 if level is None else 75) <= len(samples) <= 80, (level, len(samples))
        assert all(s["flags"] == RANGE_ERROR | IMU_ERROR | LATE for s in samples), (level, samples[-1])
        assert all(s["count"] == 0 and s["temperature"] == -32768 for s in samples[50:])
        unit.bus.stuck, unit.bus.held = False, None
        unit.run(6 * SECOND, pass_us=15_000)
        assert _all_flags(unit.run(SECOND)) == NEW


def a_warmer_range_finder_is_calibrated_anew_and_tells_so():
    unit = _well()
    starts = unit.range_finder.starts
    for raw in (0, 100, 127, -126):
        unit.lsm6ds3.temperature = raw
        assert _all_flags(unit.run(2 * SECOND)) == NEW, raw
    assert unit.range_finder.starts == starts
    for raw in (128, 0, 250, 300):
        unit.lsm6ds3.temperature = raw
        samples = unit.run(2 * SECOND)
        restarts = [s for s in samples if s["flags"] & RANGE_RESTARTED]
        assert len(restarts) == (raw != 300), raw
        assert not _all_flags(samples) & (RANGE_ERROR | IMU_ERROR | IMU_LOST | IMU_RESTARTED)
        assert max(_gaps([s for s in samples if s["flags"] & NEW])) < 100_000
    unit.lsm6ds3.power_off()
    unit.lsm6ds3.temperature = 0
    assert not _all_flags(unit.run(2 * SECOND)) & RANGE_RESTARTED


def all_goes_on_over_the_wrap_of_the_ticks():
    unit = _well((1 << 30) - 2 * SECOND)
    samples = unit.run(4 * SECOND)
    assert 199 <= len(samples) <= 201
    assert _all_flags(samples) == NEW
    assert min(steps([s["time_us"] for s in samples])) > 0


def a_silent_receiver_gets_hellos_and_the_next_session_fresh_samples():
    unit = _well()
    unit._next_beacon = unit.now.now_us + 3 * SECOND
    unit.run(3 * SECOND)
    assert len(unit.receiver.hellos) > 5
    unit.receiver.session = None
    samples = unit.run(SECOND)
    assert samples[0]["sequence"] == 1
    assert samples[-1]["imu_age"] < 5_000
    assert not _all_flags(samples) & IMU_LOST


# a range finder with zones


def _zoned(side=4, program=fake_vl53l5cx.FILE):
    """A unit that has loaded its range finder's program."""
    with open("vl53l5cx.bin", "wb") as file:
        file.write(program)
    unit = FakeUnit(zones=side)
    unit.run(6 * SECOND)
    return unit


def _measured(samples):
    return [s for s in samples if s["flags"] & NEW]


def each_zone_of_a_new_range_is_told_and_the_fields_of_the_range_are_of_the_nearest():
    for side, least, delay_us in ((4, 55, 34_000), (8, 14, 59_000)):
        unit = _zoned(side)
        zones = [(255, 0, 0, 0, 0)] * 5 + [(5, 1, 4000, 128, 0)] + [(5, 1, 8000, 128, 0)] * (side * side - 6)
        unit.range_finder.target = lambda us, zones=zones: zones
        unit.run(SECOND // 10)
        samples = unit.run(SECOND)
        new = _measured(samples)
        assert len(new) >= least, len(new)
        assert all(bool(s["zones"]) == bool(s["flags"] & NEW) for s in samples)
        assert all(delay_us <= s["age"] < delay_us + 30_000 for s in new), "a pass and the bus"
        assert {len(s["zones"]) for s in new} == {2 + 5 * side * side}
        assert {(s["status"], s["mm"]) for s in new} == {(0, 1009 if side == 4 else 1072)}
        assert not _all_flags(samples) & LATE


def lost_power_of_zones_is_told_and_begun_anew():
    unit = _zoned()
    unit.range_finder.power_off()
    unit.run(SECOND)
    unit.range_finder.power_on()
    samples = unit.run(10 * SECOND)
    assert _all_flags(samples) & RANGE_RESTARTED
    assert len(_measured(samples[-50:])) > 30


def a_unit_without_its_program_goes_on_without_ranges():
    samples = _zoned(program=b"").run(SECOND)
    assert samples
    assert not _measured(samples)
    assert all(s["flags"] & RANGE_ERROR for s in samples)
