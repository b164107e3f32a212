"""The receiver at a real socket, under a clock set by hand: what it takes in, what it makes of it, what it refuses."""

import socket
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.errors import HardwareError
from pretouch.types import RangeStatus
from pretouch.units import PORT, receiver
from pretouch.units.receiver import SkinReceiver
from pretouch.units.wire import Flag
from tests.units.fake_unit import IDS, KEYS, Bench, imu_taken


def test_before_any_unit_speaks_all_is_unknown(bench):
    readings = bench.receiver.readings()
    assert np.all(readings.stamp == -np.inf)
    assert np.all(readings.status == RangeStatus.NONE)
    assert [unit.state for unit in bench.receiver.units] == ["never heard"] * 2
    assert bench.receiver.receive() == 0


def test_a_unit_joins_and_its_readings_come_through(bench):
    bench.send(bench.units[0].hello(bench.now))
    assert bench.receiver.units[0].state == "greeting"
    assert bench.receiver.units[0].address is None, "a hello may be a recorded one, from anywhere"
    bench.deliver()
    bench.now += 0.02
    assert bench.send(bench.units[0].sample(bench.now, range_mm=612, range_status=4)) == 1
    readings, unit = bench.receiver.readings(), bench.receiver.units[0]
    assert readings.distance[0] == 0.612
    assert readings.status.tolist() == [4, RangeStatus.NONE]
    assert unit.state == "live"
    assert (unit.firmware, unit.sessions, unit.reboots, unit.accepted) == (0x0102, 1, 0, 1)
    # measured 10 ms before now; the beacon took no time at all, so only the 20 ms of the sample's hold are unsure
    assert bench.now - 0.01 - 0.0201 < readings.stamp[0] <= bench.now - 0.01
    assert unit.offset == pytest.approx(bench.units[0].offset, abs=unit.bound)


def test_no_stamp_is_later_than_the_measurement(bench):
    bench.join()
    rng = np.random.default_rng(1)
    for _ in range(200):
        bench.now += 0.02
        made, age = bench.now, int(rng.integers(0, 30_000))
        datagram = bench.units[0].sample(made, range_age_us=age)
        bench.now += rng.exponential(0.01)
        bench.send(datagram)
        bench.now += rng.exponential(0.003)
        bench.deliver()
        [received] = bench.receiver.take_samples()[-1:]
        assert received.stamp <= made - 1e-6 * age
        assert received.stamp >= made - 1e-6 * age - 2 * received.bound - 1e-5
        assert received.arrival >= made


def test_a_late_reading_of_which_a_better_bound_is_known_does_not_replace_a_newer_one(bench):
    unit = bench.units[0]
    bench.send(unit.hello(bench.now))
    bench.now += 0.08  # the first beacon is long on its way, so that stamps are early
    bench.deliver()
    bench.send(unit.sample(bench.now))
    bench.now += 0.05
    late = unit.sample(bench.now, range_mm=4000)
    bench.now += 0.02
    bench.send(unit.sample(bench.now, range_mm=300))
    while not bench.deliver():
        bench.wait(0.01)
    assert bench.send(unit.sample(bench.now, flags=0)) == 1
    assert bench.receiver.units[0].bound < 0.04
    assert bench.send(late) == 1
    assert bench.receiver.readings().distance[0] == 0.3


def test_readings_go_on_when_a_good_bound_drops_out_of_the_window(bench):
    bench.join()
    bench.run(5.0)
    unit, traffic, waiting, stamps = bench.units[0], bench.receiver.units[0], [], []
    for k in range(1500):
        bench.now += 0.01
        if k % 2 == 0:
            bench.send(unit.sample(bench.now))
            stamps.append(traffic.last_reading_stamp)
            assert stamps[-1] <= bench.now - 0.01
        bench.receiver.receive()
        waiting += [(bench.now + 0.15, datagram) for datagram in bench.answers()]
        while waiting and waiting[0][0] <= bench.now:
            unit.hear(waiting.pop(0)[1], bench.now)
    assert traffic.bound > 0.07
    assert np.diff(stamps) == pytest.approx(0.02, abs=1e-4)


def test_silence_lets_readings_grow_old_and_is_named(bench):
    bench.join()
    stamp = bench.receiver.readings().stamp.copy()
    bench.wait(5.0)
    assert [unit.state for unit in bench.receiver.units] == ["silent"] * 2
    np.testing.assert_array_equal(bench.receiver.readings().stamp, stamp)


def test_a_unit_greets_until_a_second_after_its_last_hello(bench):
    traffic = bench.receiver.units[0]
    for _ in range(5):
        bench.now += 0.9
        bench.send(bench.units[0].hello(bench.now))
        assert traffic.state == "greeting"
    bench.wait(0.9)
    assert traffic.state == "greeting"
    bench.wait(0.2)
    assert traffic.state == "silent"
    bench.send(bench.units[0].hello(bench.now))
    assert traffic.state == "greeting"


def test_a_bus_error_renews_no_reading(bench):
    bench.join()
    stamp = bench.receiver.readings().stamp[0]
    bench.now += 0.02
    assert bench.send(bench.units[0].sample(bench.now, flags=int(Flag.RANGE_BUS_ERROR))) == 1
    assert bench.receiver.readings().stamp[0] == stamp


def test_a_reading_that_repeats_to_the_last_digit_is_stuck_after_a_second(bench):
    bench.join()
    same = {"range_mm": 400}
    for k in range(60):
        bench.now += 0.02
        bench.send(bench.units[0].sample(bench.now, **same))
        assert k == 50 or bench.receiver.units[0].stuck == (k > 50)
    assert bench.receiver.readings().status[0] == RangeStatus.STUCK
    bench.now += 0.02
    bench.send(bench.units[0].sample(bench.now, range_mm=401))
    assert bench.receiver.readings().status[0] == RangeStatus.OK


def test_imu_samples_come_with_instants_and_units(bench):
    bench.join()
    imu_taken(bench.receiver)
    bench.now += 0.02
    counts = np.array([[0, 0, 100, 0, 0, 16393], [0, 0, 200, 0, 0, 16393]], dtype="<i2")
    bench.send(bench.units[1].sample(bench.now, imu=counts.tobytes(), imu_index=40))
    [batch] = imu_taken(bench.receiver)
    assert (batch.unit, batch.index) == (1, 40)
    np.testing.assert_allclose(batch.acceleration, [[0, 0, 9.8066]] * 2, atol=1e-3)
    np.testing.assert_allclose(batch.angular_velocity[:, 2], np.deg2rad([0.875, 1.75]))
    assert np.diff(batch.stamp) == pytest.approx(0.002)
    assert batch.stamp[-1] <= bench.now - 0.001
    assert imu_taken(bench.receiver) == []


@pytest.mark.parametrize("changes", [{"imu_scale": 0x70}, {"imu_rate_hz": 0}])
def test_imu_settings_there_are_not_leave_only_the_imu_out(bench, changes):
    bench.join()
    imu_taken(bench.receiver)
    bench.now += 0.02
    assert bench.send(bench.units[0].sample(bench.now, **changes)) == 1
    assert imu_taken(bench.receiver) == []


def test_samples_for_recordings_are_bounded_and_the_rest_is_dropped(monkeypatch):
    monkeypatch.setattr(receiver, "SAMPLES_MOST", 10)
    with Bench() as bench:
        bench.join()
        bench.run(0.2)
        samples = bench.receiver.take_samples()
        assert [(one.unit, one.sample.sequence) for one in samples[-2:]] == [(0, 11), (1, 11)]
        assert len(samples) == 10
        assert bench.receiver.take_samples() == []


def test_a_beacon_that_finds_nobody_disturbs_nothing(bench):
    with bench.new_socket() as gone:
        bench.send(bench.units[0].hello(bench.now), by=gone)
        bench.units[0].hear(bench.answers(gone)[0], bench.now)
        bench.send(bench.units[0].sample(bench.now), by=gone)
    for _ in range(200):
        bench.now += 0.02
        assert bench.receiver.receive() == 0
    bench.join()


def test_an_address_nothing_can_be_sent_to_is_counted(bench, monkeypatch):
    bench.join()
    endpoint = bench.receiver._endpoints[0]
    endpoint.address = ("255.255.255.255", 9)  # needs a permission the socket has not
    bench.wait(1.0)
    assert bench.receiver.unsent == 1


@pytest.mark.parametrize(("host", "port"), [("no.such.host.invalid", 0), ("127.0.0.1", 70000), ("192.0.2.1", 0)])
def test_an_address_that_cannot_be_had_is_an_error_of_ours(host, port):
    with pytest.raises(HardwareError, match=host):
        SkinReceiver(IDS, KEYS, host, port)


def test_units_need_a_name_of_their_own():
    with pytest.raises(HardwareError, match="named twice"):
        SkinReceiver(("unit 3", "unit 3"), KEYS)


def test_a_closed_receiver_and_one_whose_socket_is_pulled_away_say_so(bench):
    bench.receiver.close()
    bench.receiver.close()
    with pytest.raises(HardwareError, match="closed"):
        bench.receiver.receive()
    bench.receiver.readings()
    with Bench() as other:
        socket.socket(fileno=other.receiver._socket.detach()).close()
        with pytest.raises(HardwareError, match="closed"):
            other.receiver.receive()


def test_waiting_ends_with_the_first_datagram_or_in_time(bench):
    assert bench.receiver.receive(0.05) == 0
    bench.socket.sendto(bench.units[0].hello(bench.now), bench.receiver.address)
    assert bench.receiver.receive(30.0) == 0
    assert len(bench.deliver()) == 1


def test_the_port_of_units_is_none_that_any_socket_may_be_given():
    assert PORT < 32768  # the first that Linux gives to a socket which asks for none


def test_without_the_right_to_more_the_queue_is_as_long_as_the_system_allows():
    options = []

    def set_option(_level, option, value):
        options.append((option, value))
        if option != socket.SO_RCVBUF:
            raise PermissionError

    receiver._widen(SimpleNamespace(setsockopt=set_option))
    assert options[-1] == (socket.SO_RCVBUF, receiver.BUFFER_BYTES)
