"""The driver of the range finder on a fake one."""

from fake_bus import driven, error_of
from fake_receiver import steps
from fake_vl53l1x import FakeVl53l1x
from vl53l1x import VL53L1X


def _begun(**faults):
    clock, bus, device, sensor = driven(VL53L1X, FakeVl53l1x, **faults)
    sensor.begin()
    return clock, bus, device, sensor


def _readings(clock, sensor, seconds, poll_us=2_000):
    """Poll; return times and streams of the readings."""
    times, streams = [], []
    end = clock.now_us + int(seconds * 1e6)
    while clock.now_us < end:
        if sensor.ready():
            sensor.read()
            times.append(clock.now_us)
            streams.append(sensor.stream)
        clock.advance(poll_us)
    return times, streams


def it_ranges_at_fifty_hertz_started_once_and_counts_to_255_and_on_from_128():
    clock, _, device, sensor = _begun()
    before, starts = device.measured, device.starts
    times, streams = _readings(clock, sensor, 10)
    rate = (len(times) - 1) * 1e6 / (times[-1] - times[0])
    assert 49 < rate < 51, rate
    assert device.starts == starts
    assert len(times) == device.measured - before
    assert streams[:384] == list(range(256)) + list(range(128, 256))
    assert 0.75 * sensor.budget_us < device.duration_us() <= sensor.budget_us


def no_start_is_missed_whatever_its_clocks_are_off_by():
    for slow in (0.97, 1.03):
        for fast in (0.95, 1.05):
            clock, _, _, sensor = _begun(slow=slow, fast=fast)
            gaps = steps(_readings(clock, sensor, 1)[0])
            assert max(gaps) < 24_000, (slow, fast, max(gaps))


def a_reading_has_the_values_of_the_registers():
    clock, _, device, sensor = _begun()
    device.target = lambda us: (9, 1234, 0x0123, 0x4567, 0x0089, 0xABCD)
    clock.advance(20_000)
    assert sensor.status == 255
    sensor.read()
    assert (sensor.status, sensor.stream, sensor.mm) == (0, 0, 1234)
    assert (sensor.sigma, sensor.signal, sensor.ambient, sensor.spads) == (0x0123, 0x4567, 0x0089, 0xABCD)


def every_status_of_the_device_is_translated():
    expected = {1: 5, 2: 5, 3: 5, 4: 2, 5: 4, 6: 1, 7: 7, 8: 3, 9: 0, 12: 9, 13: 13, 18: 10, 19: 6, 22: 11}
    clock, _, device, sensor = _begun()
    for code in range(1, 32):
        device.target = lambda us, code=code: (code, 500, 10, 3000, 100, 10240)
        clock.advance(25_000)
        sensor.read()
        assert sensor.status == expected.get(code, 14), (code, sensor.status)


def a_reader_that_was_away_gets_the_newest_once():
    clock, _, device, sensor = _begun()
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
    clock, _, device, sensor = _begun()
    _readings(clock, sensor, 0.1)
    while not sensor.ready():
        clock.advance(100)
    assert abs(clock.now_us - sensor.delay_us - device.middle_us) < 500


def a_transfer_that_breaks_off_does_no_harm():
    clock, bus, _, sensor = _begun()
    _readings(clock, sensor, 0.1)
    clock.advance(20_000)
    before = sensor.stream
    bus.break_next(1)
    assert error_of(sensor.read) == 110
    assert sensor.stream == before
    assert set(steps(_readings(clock, sensor, 0.5)[1])) == {1}


def a_device_that_never_measures_or_never_boots_is_an_error():
    _, _, device, sensor = driven(VL53L1X, FakeVl53l1x)
    device._measure = lambda: None
    assert error_of(sensor.begin) == 110
    clock, _, device, sensor = driven(VL53L1X, FakeVl53l1x)
    device.read = lambda register, count: bytearray(count)
    assert error_of(sensor.begin) == 110
    assert clock.now_us < 100_000


def it_stops_and_recalibrates():
    clock, _, device, sensor = _begun()
    before = clock.now_us
    sensor.recalibrate()
    assert clock.now_us - before < 80_000
    assert bytes(device.read(8, 1)) + bytes(device.read(0x0B, 1)) == b"\x09\x00"
    assert len(_readings(clock, sensor, 0.5)[0]) > 23
    sensor.stop()
    measured = device.measured
    clock.advance(1_000_000)
    assert not sensor.ready()
    assert device.measured == measured
