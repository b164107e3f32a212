"""Keeps a unit in its Wi-Fi network and gives it datagrams; nothing here waits, no failure is an end."""

from micropython import const

_LOOK_US = const(200_000)
_ATTEMPT_US = const(15_000_000)
_FIRST_PAUSE_US = const(1_000_000)
_LONGEST_PAUSE_US = const(5_000_000)
_REFUSED_IN_A_ROW = const(100)


class Station:
    """Joins a network, and joins it again when it is lost. `wlan` is MicroPython's `network.WLAN` as a station."""

    def __init__(self, wlan, ssid, password, clock):
        self._wlan = wlan
        self._ssid = ssid
        self._password = password
        self._clock = clock
        self._trying = False
        self._pause = _FIRST_PAUSE_US
        self._next = self._until = clock.ticks()
        self.connected = False

    def step(self, now):
        """Look whether the network is there; begin or give up an attempt to join when that is due."""
        if self._clock.diff(now, self._next) < 0:
            return
        self._next = self._clock.add(now, _LOOK_US)
        self.connected = self._wlan.isconnected()
        if self.connected:
            self._trying = False
            self._pause = _FIRST_PAUSE_US
        elif not self._trying:
            self._try(now)
        elif self._clock.diff(now, self._until) >= 0:
            self._give_up(now)

    def _try(self, now):
        self._trying = True
        self._until = self._clock.add(now, _ATTEMPT_US)
        if not _taken(self._wlan.connect, self._ssid, self._password):
            self._give_up(now)

    def _give_up(self, now):
        self._trying = False
        self._next = self._clock.add(now, self._pause)
        self._pause = min(2 * self._pause, _LONGEST_PAUSE_US)
        _taken(self._wlan.disconnect)


def _taken(ask, *arguments):
    """Whether the radio took what it was asked; it refuses while it is busy with the last attempt."""
    try:
        ask(*arguments)
    except OSError:
        return False
    return True


class Datagrams:
    """The port of a `Link`: to one address, from anybody. What the network refuses is counted and never raised.

    `make` returns a fresh socket that does not wait; after many refusals in a row the old one is replaced.
    """

    def __init__(self, make, address):
        self._make = make
        self._address = address
        self._socket = None
        self._in_a_row = 0
        self.refused = 0

    def send(self, datagram):
        """Send if the network takes it."""
        try:
            if self._socket is None:
                self._socket = self._make()
            self._socket.sendto(datagram, self._address)
            self._in_a_row = 0
        except OSError:
            self._refuse()

    def _refuse(self):
        self.refused += 1
        self._in_a_row += 1
        if self._in_a_row >= _REFUSED_IN_A_ROW and self._socket is not None:
            self._in_a_row = 0
            self._socket.close()
            self._socket = None

    def receive(self, buffer):
        """Return the size of a datagram put into the buffer, or 0."""
        if self._socket is None:
            return 0
        try:
            return self._socket.readinto(buffer) or 0
        except OSError:
            return 0
