"""The driver of the range finder on a fake one. Runs in both interpreters."""

from fake_bus import Bus, Clock, error_of
from fake_vl53l1x import FakeVl53l1x
from vl53l1x import LONG, SHORT, VL53L1X


def _made(**faults):
    clock = Clock()
    bus = Bus(clock)
    device = FakeVl53l1x(clock, **faults)
    bus.add(device)
    clock.advance(10_000)
    return clock, bus, device, VL53L1X(bus, sleep_ms=clock.sleep_ms)


def _readings(clock, sensor, seconds, poll_us=2_000):
    """Poll; return (time, stream) of each reading."""
    found = []
    end = clock.now_us + int(seconds * 1e6)
    while clock.now_us < end:
        if sensor.ready():
            sensor.read()
            found.append((clock.now_us, sensor.stream))
        clock.advance(poll_us)
    return found


def it_ranges_at_fifty_hertz_started_once_and_counts_to_255_and_on_from_128():
    clock, _, device, sensor = _made()
    sensor.begin()
    before = device.measured
    starts = device.starts
    found = _readings(clock, sensor, 10)
    rate = (len(found) - 1) * 1e6 / (found[-1][0] - found[0][0])
    assert 49 < rate < 51, rate
    assert device.starts == starts
    assert len(found) == device.measured - before
    assert [stream for _, stream in found[:384]] == list(range(256)) + list(range(128, 256))


def no_start_is_missed_whatever_its_clocks_are_off_by():
    for slow in (0.97, 1.03):
        for fast in (0.95, 1.05):
            clock, _, _, sensor = _made(slow=slow, fast=fast)
            sensor.begin()
            found = _readings(clock, sensor, 1)
            gaps = [found[i + 1][0] - found[i][0] for i in range(len(found) - 1)]
            assert max(gaps) < 24_000, (slow, fast, max(gaps))


def every_budget_is_kept_in_both_modes():
    for mode in (SHORT, LONG):
        for budget in (15, 20, 33, 50, 100, 200, 500):
            if mode == LONG and budget == 15:
                continue
            clock, _, device, sensor = _made()
            sensor.begin(mode, budget, budget + 10)
            assert 0.75 * budget < device.duration_us() / 1000 <= budget, (mode, budget, device.duration_us())
            assert sensor.budget_us == 1000 * budget
            found = _readings(clock, sensor, 0.021 * (budget + 10))
            assert 18 <= len(found) <= 22, (mode, budget, len(found))


def a_budget_that_is_unknown_or_too_long_for_its_period_is_refused():
    _, _, _, sensor = _made()
    for mode, budget, period, said in (
        (SHORT, 0, 2000, "budgets are"),
        (SHORT, 21, 2000, "budgets are"),
        (LONG, 15, 40, "15 ms in short mode"),
        (SHORT, 20, 20, "a period of 20 ms"),
    ):
        assert said in error_of(sensor.begin, mode, budget, period, kind=ValueError)
    sensor.begin(SHORT, 20, 24)
    assert sensor.period_us == 24_000


def a_reading_has_the_values_of_the_registers():
    clock, _, device, sensor = _made()
    device.target = lambda us: (9, 1234, 0x0123, 0x4567, 0x0089, 0xABCD)
    sensor.begin()
    clock.advance(20_000)
    assert sensor.status == 255
    sensor.read()
    assert (sensor.status, sensor.stream, sensor.mm) == (0, 0, 1234)
    assert (sensor.sigma, sensor.signal, sensor.ambient, sensor.spads) == (0x0123, 0x4567, 0x0089, 0xABCD)


def every_status_of_the_device_is_translated():
    expected = {1: 5, 2: 5, 3: 5, 4: 2, 5: 4, 6: 1, 7: 7, 8: 3, 9: 0, 12: 9, 13: 13, 18: 10, 19: 6, 22: 11}
    clock, _, device, sensor = _made()
    sensor.begin()
    for code in range(1, 32):
        device.target = lambda us, code=code: (code, 500, 10, 3000, 100, 10240)
        clock.advance(25_000)
        sensor.read()
        assert sensor.status == expected.get(code, 14), (code, sensor.status)


def a_reader_that_was_away_gets_the_newest_once():
    clock, _, device, sensor = _made()
    sensor.begin()
    assert not sensor.ready()
    device.target = lambda us: (9, us // 1000, 10, 3000, 100, 10240)
    clock.advance(110_000)
    assert sensor.ready()
    assert sensor.ready()
    sensor.read()
    assert sensor.stream >= 4
    assert sensor.mm == device.middle_us // 1000
    assert not sensor.ready()


def the_middle_of_a_measurement_is_half_a_budget_before_it_is_ready():
    clock, _, device, sensor = _made()
    sensor.begin()
    _readings(clock, sensor, 0.1)
    while not sensor.ready():
        clock.advance(100)
    assert abs(clock.now_us - sensor.budget_us // 2 - device.middle_us) < 500


def another_chip_and_none_are_errors():
    _, _, device, sensor = _made(model=0xEEAA)
    assert error_of(sensor.begin) == 19
    device.power_off()
    assert error_of(sensor.begin) == 19


def a_failed_transfer_and_a_bus_held_down_are_told_and_do_no_harm():
    clock, bus, _, sensor = _made()
    sensor.begin()
    clock.advance(20_000)
    for action in (sensor.ready, sensor.read):
        bus.fail_next(1)
        assert error_of(action) == 19
        bus.stuck = True
        assert error_of(action) == 110
        bus.stuck = False
    assert sensor.status == 255
    sensor.read()
    assert sensor.status == 0


def a_transfer_that_breaks_off_does_no_harm():
    clock, bus, _, sensor = _made()
    sensor.begin()
    _readings(clock, sensor, 0.1)
    clock.advance(20_000)
    before = sensor.stream
    bus.break_next(1)
    assert error_of(sensor.read) == 110
    assert sensor.stream == before
    found = _readings(clock, sensor, 0.5)
    assert [stream for _, stream in found] == list(range(found[0][1], found[0][1] + len(found)))


def a_failure_anywhere_in_its_set_up_is_told_and_the_next_try_works():
    _, bus, _, sensor = _made()
    sensor.begin()
    survived = []
    for at in range(1, bus.transfers + 1):
        clock, bus, _, sensor = _made()
        bus.fail_at = at
        try:
            sensor.begin()
            survived.append(at)
        except OSError:
            sensor.begin()
        clock.advance(20_000)
        assert sensor.ready(), at
    assert survived == [3, 4], survived  # whether it has booted is asked again


def a_register_that_does_not_keep_its_value_is_an_error():
    _, _, device, sensor = _made()
    write = device._write_one
    device._write_one = lambda at, value: write(at, 1 if at == 0x6F else value)
    assert error_of(sensor.begin) == 5


def a_device_that_never_measures_or_never_boots_is_an_error():
    _, _, device, sensor = _made()
    device._measure = lambda: None
    assert error_of(sensor.begin) == 110
    clock, _, device, sensor = _made()
    device.read = lambda register, count: bytearray(count)
    assert error_of(sensor.begin) == 110
    assert clock.now_us < 100_000


def lost_power_never_reads_as_a_range():
    clock, _, device, sensor = _made()
    sensor.begin()
    _readings(clock, sensor, 0.1)
    device.power_off()
    assert error_of(sensor.ready) == 19
    clock.advance(50_000)
    device.power_on()
    clock.advance(50_000)
    assert error_of(sensor.read) == 5
    sensor.begin()
    assert len(_readings(clock, sensor, 0.5)) > 23


def a_sensor_found_ranging_is_set_up_anew():
    clock, bus, _, sensor = _made()
    sensor.begin()
    clock.advance(123_456)
    again = VL53L1X(bus, sleep_ms=clock.sleep_ms)
    again.begin()
    found = _readings(clock, again, 1)
    assert len(found) > 48
    assert found[0][1] == 0


def a_data_line_that_is_held_never_reads_as_a_range():
    clock, bus, _, sensor = _made()
    sensor.begin()
    clock.advance(20_000)
    bus.held = lambda: 0xFF
    assert sensor.ready()
    assert error_of(sensor.read) == 5
    assert error_of(sensor.begin) == 19
    bus.held = lambda: 0x00
    assert not sensor.ready()
    assert error_of(sensor.begin) == 110
    assert sensor.status == 255


def it_stops_and_recalibrates():
    clock, _, device, sensor = _made()
    sensor.begin()
    sensor.recalibrate()
    assert bytes(device.read(8, 1)) + bytes(device.read(0x0B, 1)) == b"\x09\x00"
    assert len(_readings(clock, sensor, 0.5)) > 23
    before = clock.now_us
    sensor.recalibrate()
    assert clock.now_us - before < 80_000
    sensor.stop()
    measured = device.measured
    clock.advance(1_000_000)
    assert not sensor.ready()
    assert device.measured == measured
