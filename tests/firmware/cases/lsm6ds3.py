"""The driver of the IMU on a fake one: samples, scales, set-up, failures."""

import struct

from fake_bus import driven, error_of
from fake_lsm6ds3 import FakeLsm6ds3
from lsm6ds3 import LSM6DS3, SET_SIZE

MOST = 32
WRAP_US = 1 << 30
"""Of the unit's ticks."""


def _begun(start_us=0, **faults):
    clock, bus, device, sensor = driven(LSM6DS3, FakeLsm6ds3, start_us, **faults)
    sensor.begin()
    return clock, bus, device, sensor


def _drained(sensor, most=MOST):
    buffer = memoryview(bytearray(MOST * SET_SIZE))
    count = sensor.drain(buffer, most)
    return [struct.unpack("<6h", buffer[SET_SIZE * i : SET_SIZE * (i + 1)]) for i in range(count)]


def each_sample_comes_once_and_in_order_whatever_rate_and_ticks_are():
    for start_us, rate, cycles in ((0, 1.0, 200), (0, 0.95, 100), (0, 1.05, 100), (WRAP_US - 200_000, 1.0, 20)):
        clock, _, _, sensor = _begun(start_us, rate=rate)
        numbers = []
        for _ in range(cycles):
            clock.advance(17_000)
            numbers += [sample[0] for sample in _drained(sensor)]
            assert sensor.lost == 0
        assert numbers == list(range(len(numbers)))
        seconds = (clock.now_us - start_us - 90_000) / 1e6
        assert 400 < len(numbers) / seconds / rate < 420, (start_us, rate, len(numbers) / seconds)


def one_cycle_takes_two_transfers_and_an_empty_fifo_one():
    clock, bus, _, sensor = _begun()
    before = bus.transfers
    assert _drained(sensor) == []
    assert bus.transfers - before == 1
    clock.advance(20_000)
    started = clock.now_us
    assert len(_drained(sensor)) == 8
    assert bus.transfers - before == 3
    assert clock.now_us - started < 3_000


def what_does_not_fit_waits():
    clock, _, _, sensor = _begun()
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
            clock, _, _, sensor = _begun(identity=identity)
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
            clock, _, _, sensor = _begun(identity=identity)
            clock.advance(away_us)
            for _ in range(2):
                for sample in _drained(sensor):
                    assert sample[1:] == (2, -3, 4, -5, 8192), (away_us, sample)


def a_shifted_pattern_is_aligned():
    for words in range(1, 6):
        clock, _, device, sensor = _begun()
        clock.advance(50_000)
        device.slip(words)
        samples = _drained(sensor)
        assert samples[0] == (1, 2, -3, 4, -5, 8192), (words, samples[0])
        assert sensor.lost == 1, (words, sensor.lost)
        clock.advance(20_000)
        assert _drained(sensor)[0][1:] == (2, -3, 4, -5, 8192)
        assert sensor.lost == 0


def it_is_found_at_both_addresses():
    for address in (0x6A, 0x6B):
        for identity in (0x69, 0x6A):
            clock, _, _, sensor = _begun(address=address, identity=identity)
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
        _, _, device, sensor = _begun(identity=identity)
        device.temperature = raw
        assert sensor.temperature_cdeg() == expected


def noise_on_the_data_line_is_an_error_and_no_sample():
    clock, bus, _, sensor = _begun()
    errors, noise = [], _noise()
    for _ in range(200):
        sensor.begin()
        clock.advance(20_000)
        bus.held = noise
        try:
            _drained(sensor)
        except OSError as error:
            errors.append(error.args[0])
        bus.held = None
    assert set(errors) == {5}
    assert len(errors) >= 198, "1 in 300 looks as if it could be"


def _noise():
    """Bytes of a generator with a fixed seed."""
    state = [1]

    def byte():
        state[0] = (state[0] * 69069 + 1) & 0x3FFFFFFF
        return state[0] >> 16 & 0xFF

    return byte


def a_failed_transfer_loses_nothing():
    clock, bus, _, sensor = _begun()
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
        clock, bus, _, sensor = _begun()
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
