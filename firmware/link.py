"""The unit's side of a session with the receiver: hello until a beacon opens one, samples until beacons cease.

Nothing of a session outlives it: each begins from a random challenge that was never used before, so neither an old
beacon nor an old sample verifies again.
"""

from micropython import const
from wire import BEACON_SIZE, Mac, hello, open_beacon, session_mac

_HELLO_LEAST_US = const(75_000)
_HELLO_SPREAD_US = const(50_000)
_SILENCE_US = const(2_000_000)
_CHALLENGE_SIZE = const(8)
_MOST_PER_STEP = const(4)
_LARGEST = const(64)
_LAST_SEQUENCE = const(0xFFFFFFFF)
"""Of a session; after 2.7 years of one."""


class Link:
    """Keeps a session open, and sends samples in it.

    `port` has `send(datagram)` and `receive(buffer) -> size or 0`, neither of which waits or raises; `draw(n)` returns
    n random bytes; `firmware` is major version * 256 + minor; `reset` is why the unit began anew, as on the wire.
    """

    def __init__(self, unit, key, port, clock, draw, firmware, reset):
        self._unit = unit
        self._mac = Mac(key)
        self._port = port
        self._clock = clock
        self._draw = draw
        self._firmware = firmware
        self._reset = reset
        self._buffer = bytearray(_LARGEST)
        self._session = self._nonce = self._challenge = None
        self._sequence = self._beacon = 0
        self._heard = self._next_hello = clock.ticks()

    @property
    def live(self):
        """Whether there is a session."""
        return self._session is not None

    def step(self, now):
        """Take in beacons, leave a session whose beacons ceased, ask for one."""
        for _ in range(_MOST_PER_STEP):
            size = self._port.receive(self._buffer)
            if not size:
                break
            if size == BEACON_SIZE and self._challenge is not None:
                self._take(bytes(memoryview(self._buffer)[:size]), self._clock.ticks())
        if self.live and (self._sequence >= _LAST_SEQUENCE or self._clock.diff(now, self._heard) > _SILENCE_US):
            self._session = self._nonce = self._challenge = None
            self._next_hello = now
        if not self.live and self._clock.diff(now, self._next_hello) >= 0:
            self._greet(now)

    def send(self, sample, now):
        """Send a sample as of now in the session there is."""
        self._sequence += 1
        sample.sequence = self._sequence
        sample.time_us = self._clock.us(now)
        sample.beacon = self._beacon
        sample.beacon_hold_us = self._clock.diff(now, self._heard)
        self._port.send(sample.seal(self._session))

    def _take(self, datagram, heard):
        beacon = open_beacon(datagram, self._unit, self._challenge, self._mac)
        if beacon is None:
            return
        number, nonce = beacon
        if not self.live:
            self._nonce = nonce
            self._session = session_mac(self._mac, self._challenge, nonce)
            self._sequence = 0
        elif nonce != self._nonce or number <= self._beacon:
            return
        self._beacon = number
        self._heard = heard

    def _greet(self, now):
        if self._challenge is None:
            self._challenge = self._draw(_CHALLENGE_SIZE)
        uptime = self._clock.us(now)
        self._port.send(hello(self._unit, self._firmware, self._reset, self._challenge, uptime, self._mac))
        pause = _HELLO_LEAST_US + _HELLO_SPREAD_US * self._draw(1)[0] // 255
        self._next_hello = self._clock.add(now, pause)
