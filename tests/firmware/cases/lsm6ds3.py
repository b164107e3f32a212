"""The driver of the IMU on a fake one: samples, scales, set-up, failures."""

import struct

from fake_bus import Bus, Clock, error_of
from fake_lsm6ds3 import FakeLsm6ds3
from lsm6ds3 import LSM6DS3, SET_SIZE

MOST = 32
WRAP_US = 1 << 30
"""Of the unit's ticks."""


def _made(start_us=0, **faults):
    clock = Clock(start_us)
    bus = Bus(clock)
    device = FakeLsm6ds3(clock, **faults)
    bus.add(device)
    clock.advance(10_000)
    sensor = LSM6DS3(bus, sleep_ms=clock.sleep_ms, ticks_us=clock.ticks_us, ticks_diff=clock.ticks_diff)
    return clock, bus, device, sensor


def _drained(sensor, most=MOST):
    buffer = memoryview(bytearray(MOST * SET_SIZE))
    count = sensor.drain(buffer, most)
    return [struct.unpack("<6h", buffer[SET_SIZE * i : SET_SIZE * (i + 1)]) for i in range(count)]


def each_sample_comes_once_and_in_order_whatever_rate_and_ticks_are():
    for start_us, rate, cycles in ((0, 1.0, 200), (0, 0.95, 100), (0, 1.05, 100), (WRAP_US - 200_000, 1.0, 20)):
        clock, _, _, sensor = _made(start_us, rate=rate)
        sensor.begin()
        numbers = []
        for _ in range(cycles):
            clock.advance(17_000)
            numbers += [sample[0] for sample in _drained(sensor)]
            assert sensor.lost == 0
        assert numbers == list(range(len(numbers)))
        seconds = (clock.now_us - start_us - 90_000) / 1e6
        assert 400 < len(numbers) / seconds / rate < 420, (start_us, rate, len(numbers) / seconds)


def one_cycle_takes_two_transfers_and_an_empty_fifo_one():
    clock, bus, _, sensor = _made()
    sensor.begin()
    before = bus.transfers
    assert _drained(sensor) == []
    assert bus.transfers - before == 1
    clock.advance(20_000)
    started = clock.now_us
    assert len(_drained(sensor)) == 8
    assert bus.transfers - before == 3
    assert clock.now_us - started < 3_000


def what_does_not_fit_waits():
    clock, _, _, sensor = _made()
    sensor.begin()
    clock.advance(100_000)
    assert [sample[0] for sample in _drained(sensor)] == list(range(32))
    assert sensor.waiting in (9, 10)
    assert [sample[0] for sample in _drained(sensor)][:9] == list(range(32, 41))
    assert sensor.waiting == 0
    clock.advance(100_000)
    assert len(_drained(sensor, 5)) == 5


def an_overrun_is_told_and_what_follows_is_whole():
    for identity, held in ((0x69, 682), (0x6A, 341)):
        for away_ms in range(1000, 3000, 289):
            clock, _, _, sensor = _made(identity=identity)
            sensor.begin()
            clock.advance(20_000)
            before = _drained(sensor)[-1][0]
            clock.advance(1000 * away_ms)
            samples = _drained(sensor)
            missing = samples[0][0] - before - 1
            assert abs(sensor.lost - missing) <= 2, (away_ms, sensor.lost, missing)
            assert bool(sensor.lost) == (0.416 * away_ms > held - 8), (away_ms, sensor.lost)
            while sensor.waiting:
                following = _drained(sensor)
                assert sensor.lost == 0
                samples += following
            assert [sample[0] for sample in samples] == list(range(samples[0][0], samples[0][0] + len(samples)))
            assert all(sample[1:] == (2, -3, 4, -5, 8192) for sample in samples)


def a_fifo_that_runs_over_while_it_is_read_gives_no_mixed_sample():
    for identity, full_us in ((0x69, 1_640_000), (0x6A, 820_000)):
        for away_us in range(full_us - 25_000, full_us + 10_000, 970):
            clock, _, _, sensor = _made(identity=identity)
            sensor.begin()
            clock.advance(away_us)
            for _ in range(2):
                for sample in _drained(sensor):
                    assert sample[1:] == (2, -3, 4, -5, 8192), (away_us, sample)


def a_shifted_pattern_is_aligned():
    for words in range(1, 6):
        clock, _, device, sensor = _made()
        sensor.begin()
        clock.advance(50_000)
        device.slip(words)
        samples = _drained(sensor)
        assert samples[0] == (1, 2, -3, 4, -5, 8192), (words, samples[0])
        assert sensor.lost == 1, (words, sensor.lost)
        clock.advance(20_000)
        assert _drained(sensor)[0][1:] == (2, -3, 4, -5, 8192)
        assert sensor.lost == 0


def all_scales_and_rates_are_set_and_told():
    for i, (g, bits) in enumerate(((2, 0), (4, 2), (8, 3), (16, 1))):
        for j, (dps, gyroscope) in enumerate(((125, 0x02), (245, 0x00), (500, 0x04), (1000, 0x08), (2000, 0x0C))):
            _, _, device, sensor = _made()
            sensor.begin(833, g, dps)
            assert sensor.scale_code == j << 4 | i
            assert bytes(device.read(0x10, 2)) == bytes((0x70 | bits << 2, 0x70 | gyroscope))
    for rate in (26, 52, 104, 208, 416, 833, 1660):
        clock, _, _, sensor = _made()
        sensor.begin(rate)
        assert sensor.rate_hz == rate
        clock.advance(200_000)
        assert abs(len(_drained(sensor)) + sensor.waiting - rate / 5) <= 2, rate


def unknown_scales_and_rates_are_errors():
    for arguments in ((400, 4, 500), (416, 3, 500), (416, 4, 250)):
        _, _, _, sensor = _made()
        assert "rates are" in error_of(sensor.begin, *arguments, kind=ValueError)


def it_is_found_at_both_addresses():
    for address in (0x6A, 0x6B):
        for identity in (0x69, 0x6A):
            clock, _, _, sensor = _made(address=address, identity=identity)
            sensor.begin()
            clock.advance(20_000)
            assert len(_drained(sensor)) == 8


def the_temperature_has_the_scale_of_the_chip():
    for identity, raw, expected in (
        (0x69, 0, 2500),
        (0x69, 16, 2600),
        (0x69, -16 * 30, -500),
        (0x6A, 256 * 10, 3500),
        (0x6A, -128, 2450),
    ):
        _, _, device, sensor = _made(identity=identity)
        sensor.begin()
        device.temperature = raw
        assert sensor.temperature_cdeg() == expected


def a_sensor_found_running_is_set_up_anew():
    clock, _, _, sensor = _made()
    sensor.begin(833, 16, 2000)
    clock.advance(1_000_000)
    sensor.begin()
    clock.advance(20_000)
    samples = _drained(sensor)
    assert [sample[0] for sample in samples] == list(range(8))
    assert sensor.lost == 0


def another_chip_and_none_are_errors():
    _, _, device, sensor = _made(identity=0x6C)
    assert error_of(sensor.begin) == 19
    device.power_off()
    assert error_of(sensor.begin) == 19


def a_bus_held_down_is_an_error():
    _, bus, _, sensor = _made()
    bus.stuck = True
    assert error_of(sensor.begin) == 110
    bus.stuck = False
    sensor.begin()
    bus.stuck = True
    assert error_of(_drained, sensor) == 110
    assert error_of(sensor.temperature_cdeg) == 110


def a_data_line_that_is_held_or_full_of_noise_is_an_error_and_no_sample():
    for byte, most in ((lambda: 0x00, 0), (lambda: 0xFF, 0), (_noise(), 2)):
        clock, bus, _, sensor = _made()
        errors = []
        for _ in range(200):
            sensor.begin()
            clock.advance(20_000)
            bus.held = byte
            try:
                _drained(sensor)
            except OSError as error:
                errors.append(error.args[0])
            bus.held = None
        assert set(errors) == {5}
        assert len(errors) >= 200 - most, "of noise, 1 in 300 looks as if it could be"
        bus.held = byte
        assert error_of(sensor.begin) in (5, 19, 110)
        bus.held = None
        sensor.begin()
        clock.advance(20_000)
        assert len(_drained(sensor)) == 8


def _noise():
    """Bytes of a generator with a fixed seed."""
    state = [1]

    def byte():
        state[0] = (state[0] * 69069 + 1) & 0x3FFFFFFF
        return state[0] >> 16 & 0xFF

    return byte


def a_failed_transfer_loses_nothing():
    clock, bus, _, sensor = _made()
    sensor.begin()
    numbers = []
    for cycle in range(100):
        clock.advance(17_000)
        bus.fail_next(1 if cycle % 5 == 0 else 0)
        try:
            numbers += [sample[0] for sample in _drained(sensor)]
        except OSError:
            continue
        assert sensor.lost == 0
    assert numbers == list(range(len(numbers)))


def what_a_transfer_that_breaks_off_takes_with_it_is_told():
    for backlog_ms in (20, 100, 1000, 3000):
        clock, bus, _, sensor = _made()
        sensor.begin()
        clock.advance(1000 * backlog_ms)
        sensor.drain(memoryview(bytearray(MOST * SET_SIZE)), 1)
        clock.advance(20_000)
        last = _drained(sensor, 1)[0][0]
        bus._transfer = _breaking_data(bus, bus._transfer)
        assert error_of(_drained, sensor) == 110
        clock.advance(20_000)
        samples = _drained(sensor)
        missing = samples[0][0] - last - 1
        assert missing > 0
        assert abs(sensor.lost - missing) <= 1, (backlog_ms, sensor.lost, missing)
        clock.advance(20_000)
        assert _drained(sensor)[0][0] == samples[-1][0] + 1
        assert sensor.lost == 0


def _breaking_data(bus, transfer):
    def breaking(address, register, count, addrsize):
        if register == 0x3E and count > 2:
            bus._transfer = transfer
            bus.break_next(1)
        return transfer(address, register, count, addrsize)

    return breaking


def a_failure_anywhere_in_its_set_up_is_told_and_the_next_try_works():
    _, bus, _, sensor = _made()
    sensor.begin()
    for at in range(1, bus.transfers + 1):
        clock, bus, _, sensor = _made()
        bus.fail_at = at
        assert error_of(sensor.begin) == 19
        sensor.begin()
        clock.advance(20_000)
        assert _drained(sensor)[0] == (0, 2, -3, 4, -5, 8192)


def a_register_that_does_not_keep_its_value_is_an_error():
    for register in (0x08, 0x0A, 0x10, 0x11):
        _, _, device, sensor = _made()
        write = device._write_one
        device._write_one = lambda at, value, lost=register, write=write: None if at == lost else write(at, value)
        assert error_of(sensor.begin) == 5, register


def lost_power_is_an_error_and_never_silence():
    clock, _, device, sensor = _made()
    sensor.begin()
    clock.advance(20_000)
    _drained(sensor)
    device.power_off()
    assert error_of(_drained, sensor) == 19
    device.power_on()
    clock.advance(100_000)
    assert error_of(_drained, sensor) in (5, 19)
    sensor.begin()
    clock.advance(20_000)
    assert len(_drained(sensor)) == 8
