"""Joining the network, and sending while it comes and goes."""

import socket

import machine
import network
from clock import Clock
from fake_bus import Clock as FakeClock
from fake_receiver import FakeReceiver, steps
from wifi import Datagrams, Station


def _station():
    network.state.__init__()
    network.state.takes_us = 1_500_000
    fake = machine.state.clock = FakeClock()
    clock = Clock(fake)
    return fake, clock, network.state, Station(network.WLAN(network.STA_IF), "net", "password", clock)


def _pass(fake, clock, station, seconds):
    for _ in range(seconds * 50):
        fake.advance(20_000)
        station.step(clock.ticks())


def joins_asks_again_at_once_when_the_network_is_lost_and_is_back_when_it_is():
    fake, clock, radio, station = _station()
    _pass(fake, clock, station, 3)
    assert station.connected
    radio.there = False
    _pass(fake, clock, station, 1)
    assert not station.connected
    assert [each[1:] for each in radio.asked] == [("net", "password")] * 2
    radio.there = True
    _pass(fake, clock, station, 20)
    assert station.connected


def pauses_between_attempts_grow_to_5_s():
    fake, clock, radio, station = _station()
    radio.there = False
    _pass(fake, clock, station, 400)
    gaps = [(step + 250_000) // 1_000_000 for step in steps([each[0] for each in radio.asked])]
    assert gaps[:3] == [16, 17, 19], gaps
    assert set(gaps[3:]) == {20}, gaps
    assert radio.disconnects - len(gaps) in (0, 1)


def a_radio_that_refuses_is_asked_again():
    fake, clock, radio, station = _station()
    radio.busy = 2
    _pass(fake, clock, station, 8)
    assert station.connected
    assert len(radio.asked) == 3


def _receiver():
    """A receiver in the network that only notes what comes."""
    network.state.__init__()
    machine.state.clock = FakeClock()
    network.WLAN(network.STA_IF).connect("net", "password")
    receiver = socket.state.receiver = FakeReceiver(7, bytes(32))
    receiver.send = lambda datagram: receiver.samples.append(bytes(datagram))
    return receiver


def datagrams_come_and_go_and_errors_of_the_network_are_counted_and_no_end():
    receiver, udp, buffer = _receiver(), socket.socket(), bytearray(10)
    port = Datagrams(lambda: udp, ("host", 1))
    assert port.receive(buffer) == 0
    receiver.inbox.append(b"abc")
    for udp.errno in (11, 12, 101, 113, 118):
        port.send(b"lost")
        assert port.receive(buffer) == 0
    assert port.refused == 5
    udp.errno = 0
    port.send(b"sent")
    assert receiver.samples == [b"sent"]
    assert ("host", 1) in socket.state.sent_to
    assert port.receive(buffer) == 3
    assert bytes(buffer[:3]) == b"abc"
    assert port.receive(buffer) == 0


def a_socket_that_refuses_for_long_is_replaced():
    receiver, bad, good = _receiver(), socket.socket(), socket.socket()
    bad.errno, left = 9, [bad, good]
    port = Datagrams(lambda: left.pop(0), ("host", 1))
    for _ in range(101):
        port.send(b"x")
    assert bad.closed
    assert receiver.samples == [b"x"]


def no_memory_for_a_socket_is_no_end():
    def make():
        raise OSError(12)

    port = Datagrams(make, ("host", 1))
    for _ in range(300):
        port.send(b"x")
    assert port.refused == 300
