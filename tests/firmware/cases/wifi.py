"""Joining the network, and sending while it comes and goes."""

from clock import Clock
from fake_bus import Clock as FakeClock
from fake_receiver import steps
from wifi import Datagrams, Station


class _Wlan:
    """A radio; `there` is whether the network answers, 1.5 s after it was asked."""

    def __init__(self, clock):
        self.clock = clock
        self.there = True
        self.asked = []
        self.busy = 0
        self.disconnects = 0
        self._joined_us = None

    def isconnected(self):
        return self.there and self._joined_us is not None and self.clock.now_us >= self._joined_us

    def connect(self, ssid, password):
        self.asked.append((self.clock.now_us, ssid, password))
        if self.busy:
            self.busy -= 1
            raise OSError("Wifi Internal Error")
        self._joined_us = self.clock.now_us + 1_500_000

    def disconnect(self):
        self.disconnects += 1
        self._joined_us = None


def _station():
    fake = FakeClock()
    clock = Clock(fake)
    wlan = _Wlan(fake)
    return fake, clock, wlan, Station(wlan, "net", "password", clock)


def _pass(fake, clock, station, seconds):
    for _ in range(seconds * 50):
        fake.advance(20_000)
        station.step(clock.ticks())


def joins_asks_again_at_once_when_the_network_is_lost_and_is_back_when_it_is():
    fake, clock, wlan, station = _station()
    _pass(fake, clock, station, 3)
    assert station.connected
    wlan.there = False
    _pass(fake, clock, station, 1)
    assert not station.connected
    assert [each[1:] for each in wlan.asked] == [("net", "password")] * 2
    wlan.there = True
    _pass(fake, clock, station, 20)
    assert station.connected


def pauses_between_attempts_grow_to_5_s():
    fake, clock, wlan, station = _station()
    wlan.there = False
    _pass(fake, clock, station, 400)
    times = [each[0] for each in wlan.asked]
    gaps = [(step + 250_000) // 1_000_000 for step in steps(times)]
    assert gaps[:3] == [16, 17, 19], gaps
    assert set(gaps[3:]) == {20}, gaps
    assert wlan.disconnects == len(gaps) or wlan.disconnects == len(gaps) + 1


def a_radio_that_refuses_is_asked_again():
    fake, clock, wlan, station = _station()
    wlan.busy = 2
    _pass(fake, clock, station, 8)
    assert station.connected
    assert len(wlan.asked) == 3


class _Socket:
    def __init__(self, errno=None):
        self.errno = errno
        self.sent = []
        self.inbox = []
        self.closed = False

    def sendto(self, datagram, address):
        if self.errno:
            raise OSError(self.errno)
        self.sent.append((bytes(datagram), address))

    def readinto(self, buffer):
        if self.errno:
            raise OSError(self.errno)
        if not self.inbox:
            return None
        datagram = self.inbox.pop(0)
        buffer[: len(datagram)] = datagram
        return len(datagram)

    def close(self):
        self.closed = True


def datagrams_come_and_go_and_errors_of_the_network_are_counted_and_no_end():
    socket = _Socket()
    port = Datagrams(lambda: socket, ("host", 1))
    buffer = bytearray(10)
    assert port.receive(buffer) == 0
    socket.inbox.append(b"abc")
    for errno in (11, 12, 101, 113, 118):
        socket.errno = errno
        port.send(b"lost")
        assert port.receive(buffer) == 0
    assert port.refused == 5
    socket.errno = None
    port.send(b"sent")
    assert socket.sent == [(b"sent", ("host", 1))]
    assert port.receive(buffer) == 3
    assert bytes(buffer[:3]) == b"abc"
    assert port.receive(buffer) == 0


def a_socket_that_refuses_for_long_is_replaced():
    bad, good = _Socket(9), _Socket()
    left = [bad, good]
    port = Datagrams(lambda: left.pop(0), ("host", 1))
    for _ in range(101):
        port.send(b"x")
    assert bad.closed
    assert good.sent == [(b"x", ("host", 1))]


def no_memory_for_a_socket_is_no_end():
    def make():
        raise OSError(12)

    port = Datagrams(make, ("host", 1))
    for _ in range(300):
        port.send(b"x")
    assert port.refused == 300
