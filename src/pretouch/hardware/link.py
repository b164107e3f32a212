"""The receiver's side of the session with one unit: what it believes, and what it answers. No socket, no clock.

A unit out of session sends hellos with a challenge; each challenge is answered by a beacon with a fresh nonce, which
makes a pending session. A sample that verifies under a pending session shows that the unit took it: it is the live one
from then on, and the one before is forgotten. Hellos can be recorded and sent again, so they alone change nothing that
is live; samples and beacons belong to one challenge and one nonce, so none of an earlier session ever verifies.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, Positive, PositiveCount
from pretouch.hardware.wire import (
    CHALLENGE_SIZE,
    NONCE_SIZE,
    PREFIX,
    Beacon,
    Hello,
    Mac,
    Sample,
    decode_hello,
    decode_sample,
    session_mac,
)

WIDTH = 64
"""Sequence numbers that may arrive out of order."""
_ALL = (1 << WIDTH) - 1
_CHALLENGE = slice(PREFIX.size + 4, PREFIX.size + 4 + CHALLENGE_SIZE)
"""Of a hello."""
_REMEMBERED = 64
"""Beacons of a session whose instants are kept."""


@dataclass(frozen=True)
class LinkParams(Checked):
    """How a receiver treats its units."""

    beacon_period_s: Positive = 0.25
    """Time between the beacons to a unit [s]. Without one for 2 s it leaves the session (docs/hardware/wire.md). Where
    30 % are lost, that happens once in an hour and a half with eight in that time, and every minute and a half with
    four."""
    pending_most: PositiveCount = 4
    """Most sessions offered to one unit at once."""
    pending_expiry_s: Positive = 5.0
    """How long an offer stands after the last hello that asked for it [s]."""
    answers_per_s: Annotated[float, Check(low=1.0)] = 20.0
    """Most hellos of one unit that are answered in a second; a unit says ten."""
    tries_per_s: Annotated[float, Check(low=1.0)] = 200.0
    """Most samples of one unit that are tried against its offers in a second, so that offers nobody takes do not make
    a flood of forged samples five times as dear; a unit sends fifty."""
    drift_ppm: Positive = 50.0
    """Largest difference in rate between a unit's clock and the host's [1e-6] (crystals of 20 ppm, their temperature,
    and the steering of the host's clock)."""
    clock_window_s: Positive = 10.0
    """How long a bound on a unit's clock counts [s]."""
    silent_after_s: Positive = 0.3
    """Time without a sample after which a unit is called silent [s]; the controller judges by itself."""
    stuck_after_s: Positive = 1.0
    """How long a unit may repeat a reading to the last digit before it counts as stuck [s]; noise alone changes it."""
    samples_most: PositiveCount = 8192
    """Most samples kept until they are taken: 4 s of 40 units."""
    drain_most: PositiveCount = 1024
    """Most datagrams taken in by one call of `receive`: a flood must not keep it for ever."""
    buffer_kib: PositiveCount = 4096
    """Size asked of the system for the queue of arrived datagrams [KiB]; more than half of it is bookkeeping."""


class Window:
    """Which sequence numbers of a session have been accepted."""

    def __init__(self) -> None:
        self.newest = 0
        self._seen = _ALL
        """Bit k: the number `newest` - k was accepted; there are none below 1 to miss."""

    def admits(self, sequence: int) -> bool:
        """Whether a number is new: greater than all, or one of the last 64 and not seen yet."""
        behind = self.newest - sequence
        return behind < 0 or (behind < WIDTH and not self._seen >> behind & 1)

    def take(self, sequence: int) -> int:
        """Mark a number that is admitted; return how many were given up as lost by it."""
        ahead = sequence - self.newest
        if ahead <= 0:
            self._seen |= 1 << -ahead
            return 0
        self.newest = sequence
        if ahead == 1:
            lost = 1 - (self._seen >> WIDTH - 1)
        else:
            dropped = min(ahead, WIDTH)
            lost = dropped - (self._seen >> WIDTH - dropped).bit_count() + ahead - dropped
        self._seen = (self._seen << min(ahead, WIDTH) | 1) & _ALL
        return lost

    def missing(self) -> int:
        """Return how many of the last 64 numbers have not come (yet)."""
        return WIDTH - self._seen.bit_count()


class Allowance:
    """So many a second, and as many at once."""

    def __init__(self, rate: float) -> None:
        self.rate = self.left = rate
        self._counted = -math.inf

    def refill(self, now: float) -> float:
        """Return how many are left at an instant [s]."""
        self.left = min(self.rate, self.left + self.rate * max(now - self._counted, 0.0))
        self._counted = now
        return self.left


class Session:
    """One challenge of a unit and one nonce of the receiver."""

    def __init__(self, key: Mac, hello: Hello, nonce: bytes, now: float) -> None:
        self.hello, self.nonce, self.asked = hello, nonce, now
        self.mac = session_mac(key, hello.challenge, nonce)
        self.window = Window()
        self.number = 0
        """Of the last beacon."""
        self.sent: dict[int, float] = {}
        """When the last 64 beacons were sent [s]."""

    def beacon(self, key: Mac, now: float) -> bytes:
        """Make the next beacon, to be sent at once."""
        self.number += 1
        self.sent[self.number] = now
        self.sent.pop(self.number - _REMEMBERED, None)
        return Beacon(self.hello.unit, self.number, self.nonce).encode(key, self.hello.challenge)


class Link:
    """What the receiver knows of one unit's sessions."""

    def __init__(self, key: bytes, params: LinkParams, draw: Callable[[int], bytes]) -> None:
        """Know of no session; `draw` gives so many random bytes."""
        self._key, self._params, self._draw = Mac(key), params, draw
        self.live: Session | None = None
        self._pending: dict[bytes, Session] = {}
        self._answers, self._tries = Allowance(params.answers_per_s), Allowance(params.tries_per_s)
        self._answered: dict[bytes, float] = {}
        self.beacon_due = math.inf
        """When the live session's next beacon is to be sent [s]."""

    @property
    def pending(self) -> int:
        """Sessions that are offered."""
        return len(self._pending)

    def hello(self, datagram: memoryview, now: float) -> bytes | str:
        """Return the answer to a datagram that looks like a hello, to be sent at once; or why there is none."""
        challenge = bytes(datagram[_CHALLENGE])
        if self.live is not None and challenge == self.live.hello.challenge:
            return "old hello"
        if not self._affordable(challenge, now):
            return "too many hellos"
        hello = decode_hello(datagram, self._key)
        if hello is None:
            return "tag"
        self._spend(challenge, now)
        session = self._pending.pop(hello.challenge, None)
        if session is None:
            session = Session(self._key, hello, self._draw(NONCE_SIZE), now)
        session.asked = now
        while len(self._pending) >= self._params.pending_most:
            del self._pending[next(iter(self._pending))]
        self._pending[hello.challenge] = session
        return session.beacon(self._key, now)

    def sample(self, datagram: memoryview, sequence: int, now: float) -> tuple[Session, Sample, int] | str:
        """Return the session of what looks like a sample, what it says, and how many it shows to be lost.

        Its session is the live one afterwards. If it is not to be believed, return why.
        """
        if self.live is None and not self._pending:
            return "no session"
        reason = "replayed"
        if self.live is not None and self.live.window.admits(sequence):
            sample = decode_sample(datagram, self.live.mac)
            if sample is not None:
                return self.live, sample, self.live.window.take(sequence)
            reason = "tag"
        if self._pending:
            if self._tries.refill(now) < 1.0:
                return "too many samples"
            self._tries.left -= 1.0
        for challenge, session in self._pending.items():
            sample = decode_sample(datagram, session.mac) if session.window.admits(sequence) else None
            if sample is not None:
                del self._pending[challenge]
                given_up = self.live.window.missing() if self.live else 0
                self.live = session
                self.beacon_due = max(session.sent.values()) + self._params.beacon_period_s
                return session, sample, session.window.take(sequence) + given_up
            reason = "tag"
        return reason

    def beacon(self, now: float) -> bytes | None:
        """Return the live session's next beacon, to be sent at once, if there is a live one."""
        if self.live is None:
            return None
        self.beacon_due = now + self._params.beacon_period_s
        return self.live.beacon(self._key, now)

    def expire(self, now: float) -> None:
        """Forget offers that were not taken."""
        for challenge in [c for c, s in self._pending.items() if now - s.asked > self._params.pending_expiry_s]:
            del self._pending[challenge]

    def _affordable(self, challenge: bytes, now: float) -> bool:
        """Whether a challenge may have an answer: while answers are scarce, one a second.

        So recorded hellos, sent again and again, do not use up the answers that a unit needs.
        """
        left = self._answers.refill(now)
        if left < 0.5 * self._answers.rate:
            return left >= 1.0 and now - self._answered.get(challenge, -math.inf) >= 1.0
        return True

    def _spend(self, challenge: bytes, now: float) -> None:
        self._answers.left -= 1.0
        self._answered.pop(challenge, None)
        self._answered[challenge] = now
        if len(self._answered) > 2 * self._answers.rate:
            del self._answered[next(iter(self._answered))]
