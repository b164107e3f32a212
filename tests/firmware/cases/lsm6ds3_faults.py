"""The driver of the IMU on a fake one that fails. Runs in both interpreters."""

from fake_bus import error_of
from imu_bench import MOST, drained, made
from lsm6ds3 import SET_SIZE


def another_chip_is_an_error():
    _, _, _, sensor = made(identity=0x6C)
    assert error_of(sensor.begin) == 19


def no_device_is_an_error():
    _, _, device, sensor = made()
    device.power_off()
    assert error_of(sensor.begin) == 19


def a_bus_held_down_is_an_error():
    _, bus, _, sensor = made()
    bus.stuck = True
    assert error_of(sensor.begin) == 110
    bus.stuck = False
    sensor.begin()
    bus.stuck = True
    assert error_of(drained, sensor) == 110
    assert error_of(sensor.temperature_cdeg) == 110


def a_data_line_that_is_held_or_full_of_noise_is_an_error_and_no_sample():
    for byte, most in ((lambda: 0x00, 0), (lambda: 0xFF, 0), (_noise(), 2)):
        clock, bus, _, sensor = made()
        errors = []
        for _ in range(200):
            sensor.begin()
            clock.advance(20_000)
            bus.held = byte
            try:
                drained(sensor)
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
        assert len(drained(sensor)) == 8


def _noise():
    """Bytes of a generator with a fixed seed."""
    state = [1]

    def byte():
        state[0] = (state[0] * 69069 + 1) & 0x3FFFFFFF
        return state[0] >> 16 & 0xFF

    return byte


def a_failed_transfer_loses_nothing():
    clock, bus, _, sensor = made()
    sensor.begin()
    numbers = []
    for cycle in range(100):
        clock.advance(17_000)
        bus.fail_next(1 if cycle % 5 == 0 else 0)
        try:
            numbers += [sample[0] for sample in drained(sensor)]
        except OSError:
            continue
        assert sensor.lost == 0
    assert numbers == list(range(len(numbers)))


def what_a_transfer_that_breaks_off_takes_with_it_is_told():
    for backlog_ms in (20, 100, 1000, 3000):
        clock, bus, _, sensor = made()
        sensor.begin()
        clock.advance(1000 * backlog_ms)
        sensor.drain(memoryview(bytearray(MOST * SET_SIZE)), 1)
        clock.advance(20_000)
        last = drained(sensor, 1)[0][0]
        bus._transfer = _breaking_data(bus, bus._transfer)
        assert error_of(drained, sensor) == 110
        clock.advance(20_000)
        samples = drained(sensor)
        missing = samples[0][0] - last - 1
        assert missing > 0
        assert abs(sensor.lost - missing) <= 1, (backlog_ms, sensor.lost, missing)
        clock.advance(20_000)
        assert drained(sensor)[0][0] == samples[-1][0] + 1
        assert sensor.lost == 0


def _breaking_data(bus, transfer):
    def breaking(address, register, count, addrsize):
        if register == 0x3E and count > 2:
            bus._transfer = transfer
            bus.break_next(1)
        return transfer(address, register, count, addrsize)

    return breaking


def a_failure_anywhere_in_its_set_up_is_told_and_the_next_try_works():
    _, bus, _, sensor = made()
    sensor.begin()
    for at in range(bus.transfers):
        clock, bus, _, sensor = made()
        _fail_at(bus, at)
        assert error_of(sensor.begin) == 19
        sensor.begin()
        clock.advance(20_000)
        assert drained(sensor)[0] == (0, 2, -3, 4, -5, 8192)


def _fail_at(bus, at):
    transfer = bus._transfer

    def failing(*arguments):
        if bus.transfers == at:
            bus.transfers += 1
            raise OSError(19)
        return transfer(*arguments)

    bus._transfer = failing


def a_register_that_does_not_keep_its_value_is_an_error():
    for register in (0x08, 0x0A, 0x10, 0x11):
        _, _, device, sensor = made()
        _forget(device, register)
        assert error_of(sensor.begin) == 5, register


def _forget(device, register):
    write = device._write_one
    device._write_one = lambda at, value: None if at == register else write(at, value)


def lost_power_is_an_error_and_never_silence():
    clock, _, device, sensor = made()
    sensor.begin()
    clock.advance(20_000)
    drained(sensor)
    device.power_off()
    assert error_of(drained, sensor) == 19
    device.power_on()
    clock.advance(100_000)
    assert error_of(drained, sensor) in (5, 19)
    sensor.begin()
    clock.advance(20_000)
    assert len(drained(sensor)) == 8
