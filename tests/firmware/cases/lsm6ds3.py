"""The driver of the IMU on a fake one: samples, scales, set-up. Runs in both interpreters."""

from fake_bus import Refused, error_of
from imu_bench import drained, made


def each_sample_comes_once_and_in_order_through_many_cycles():
    clock, _, _, sensor = made()
    sensor.begin()
    numbers = []
    for _ in range(200):
        clock.advance(17_000)
        numbers += [sample[0] for sample in drained(sensor)]
        assert sensor.lost == 0
    assert numbers == list(range(len(numbers)))
    seconds = (clock.now_us - 90_000) / 1e6
    assert 400 < len(numbers) / seconds < 420, len(numbers) / seconds


def words_are_signed_and_in_the_order_of_the_wire():
    clock, _, device, sensor = made()
    device.sample = lambda k: (1, -2, 300, -400, 32767, -32768)
    sensor.begin()
    clock.advance(20_000)
    assert drained(sensor)[0] == (1, -2, 300, -400, 32767, -32768)


def the_gyroscope_has_settled_before_the_first_sample():
    clock, _, _, sensor = made()
    sensor.begin()
    clock.advance(5_000)
    assert drained(sensor)[0] == (0, 2, -3, 4, -5, 8192)


def one_cycle_takes_two_transfers():
    clock, bus, _, sensor = made()
    sensor.begin()
    clock.advance(20_000)
    before, started = bus.transfers, clock.now_us
    assert len(drained(sensor)) == 8
    assert bus.transfers - before == 2
    assert clock.now_us - started < 3_000


def an_empty_fifo_gives_nothing():
    _, bus, _, sensor = made()
    sensor.begin()
    before = bus.transfers
    assert drained(sensor) == []
    assert bus.transfers - before == 1


def what_does_not_fit_waits():
    clock, _, _, sensor = made()
    sensor.begin()
    clock.advance(100_000)
    assert [sample[0] for sample in drained(sensor)] == list(range(32))
    assert sensor.waiting in (9, 10)
    assert [sample[0] for sample in drained(sensor)][:9] == list(range(32, 41))
    assert sensor.waiting == 0
    clock.advance(100_000)
    assert len(drained(sensor, 5)) == 5


def an_overrun_is_told_and_what_follows_is_whole():
    for identity, held in ((0x69, 682), (0x6A, 341)):
        for away_ms in range(1000, 3000, 289):
            clock, _, _, sensor = made(identity=identity)
            sensor.begin()
            clock.advance(20_000)
            before = drained(sensor)[-1][0]
            clock.advance(1000 * away_ms)
            samples = drained(sensor)
            missing = samples[0][0] - before - 1
            assert abs(sensor.lost - missing) <= 2, (away_ms, sensor.lost, missing)
            assert bool(sensor.lost) == (0.416 * away_ms > held - 8), (away_ms, sensor.lost)
            while sensor.waiting:
                following = drained(sensor)
                assert sensor.lost == 0
                samples += following
            assert [sample[0] for sample in samples] == list(range(samples[0][0], samples[0][0] + len(samples)))
            assert all(sample[1:] == (2, -3, 4, -5, 8192) for sample in samples)


def a_fifo_that_runs_over_while_it_is_read_gives_no_mixed_sample():
    for identity, full_us in ((0x69, 1_640_000), (0x6A, 820_000)):
        for away_us in range(full_us - 25_000, full_us + 10_000, 970):
            clock, _, _, sensor = made(identity=identity)
            sensor.begin()
            clock.advance(away_us)
            for _ in range(2):
                for sample in drained(sensor):
                    assert sample[1:] == (2, -3, 4, -5, 8192), (away_us, sample)


def a_shifted_pattern_is_aligned():
    for words in range(1, 6):
        clock, _, device, sensor = made()
        sensor.begin()
        clock.advance(50_000)
        device.slip(words)
        samples = drained(sensor)
        assert samples[0] == (1, 2, -3, 4, -5, 8192), (words, samples[0])
        assert sensor.lost == 1, (words, sensor.lost)
        clock.advance(20_000)
        assert drained(sensor)[0][1:] == (2, -3, 4, -5, 8192)
        assert sensor.lost == 0


def all_scales_and_rates_are_set_and_told():
    for i, (g, bits) in enumerate(((2, 0), (4, 2), (8, 3), (16, 1))):
        for j, (dps, gyroscope) in enumerate(((125, 0x02), (245, 0x00), (500, 0x04), (1000, 0x08), (2000, 0x0C))):
            _, _, device, sensor = made()
            sensor.begin(833, g, dps)
            assert sensor.scale_code == j << 4 | i
            assert bytes(device.read(0x10, 2)) == bytes((0x70 | bits << 2, 0x70 | gyroscope))
    for rate in (26, 52, 104, 208, 416, 833, 1660):
        clock, _, _, sensor = made()
        sensor.begin(rate)
        assert sensor.rate_hz == rate
        clock.advance(200_000)
        assert abs(len(drained(sensor)) + sensor.waiting - rate / 5) <= 2, rate


def unknown_scales_and_rates_are_errors():
    for arguments in ((400, 4, 500), (416, 3, 500), (416, 4, 250)):
        _, _, _, sensor = made()
        assert "rates are" in error_of(sensor.begin, *arguments, kind=ValueError)


def a_true_rate_off_by_five_per_cent_loses_nothing():
    for rate in (0.95, 1.05):
        clock, _, _, sensor = made(rate=rate)
        sensor.begin()
        numbers = []
        for _ in range(100):
            clock.advance(17_000)
            numbers += [sample[0] for sample in drained(sensor)]
            assert sensor.lost == 0
        assert numbers == list(range(len(numbers)))


def it_is_found_at_both_addresses():
    for address in (0x6A, 0x6B):
        for identity in (0x69, 0x6A):
            clock, _, _, sensor = made(address=address, identity=identity)
            sensor.begin()
            clock.advance(20_000)
            assert len(drained(sensor)) == 8


def the_temperature_has_the_scale_of_the_chip():
    for identity, raw, expected in (
        (0x69, 0, 2500),
        (0x69, 16, 2600),
        (0x69, -16 * 30, -500),
        (0x6A, 256 * 10, 3500),
        (0x6A, -128, 2450),
    ):
        _, _, device, sensor = made(identity=identity)
        sensor.begin()
        device.temperature = raw
        assert sensor.temperature_cdeg() == expected


def a_sensor_found_running_is_set_up_anew():
    clock, _, _, sensor = made()
    sensor.begin(833, 16, 2000)
    clock.advance(1_000_000)
    sensor.begin()
    clock.advance(20_000)
    samples = drained(sensor)
    assert [sample[0] for sample in samples] == list(range(8))
    assert sensor.lost == 0


def the_unit_s_clock_may_wrap():
    clock, _, _, sensor = made(start_us=(1 << 30) - 200_000)
    sensor.begin()
    numbers = []
    for _ in range(20):
        clock.advance(17_000)
        numbers += [sample[0] for sample in drained(sensor)]
        assert sensor.lost == 0
    assert clock.now_us > 1 << 30
    assert numbers == list(range(len(numbers)))


def the_fake_refuses_what_the_device_would_not_take():
    _, bus, device, _ = made()
    for action in (
        lambda: bus.readfrom_mem(0x6A, 0x0F, 1, addrsize=16),
        lambda: bus.readfrom_mem(0x6A, 0x70, 1),
        lambda: bus.writeto_mem(0x6A, 0x0F, b"\x00"),
        lambda: bus.writeto_mem(0x6A, 0x0A, b"\x36"),
        lambda: bus.readfrom_mem(0x6A, 0x3E, 2),
    ):
        assert error_of(action, kind=Refused)
    device.write(0x12, b"\x00")
    assert error_of(device.read, 0x3A, 4, kind=Refused)
