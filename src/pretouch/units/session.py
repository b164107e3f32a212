"""The receiver's side of the session with one unit: samples it accepts, and its answers. No socket, no clock.

A unit out of session sends hellos with a challenge; each challenge is answered by a beacon with a fresh nonce, which
makes a pending session. A sample that verifies under a pending session shows that the unit took it: it is the live one
from then on, and the one before is forgotten. Hellos can be recorded and sent again, so they alone change nothing that
is live; samples and beacons belong to one challenge and one nonce, so none of an earlier session ever verifies.
"""

import math
from collections.abc import Callable

from pretouch.units.wire import (
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
"""Challenge in a hello."""
_REMEMBERED = 64
"""Beacons of a session whose instants are kept."""
_ROUNDING_S = 1e-9
BEACON_PERIOD_S = 0.25
"""Time between the beacons to a unit [s]. Without one for 2 s it leaves the session (docs/reference/wire.md). Where
30 % are lost, that happens once in an hour and a half with eight in that time, and every minute and a half with
four."""
PENDING_MOST = 4
"""Most sessions offered to one unit at once."""
PENDING_EXPIRY_S = 5.0
"""How long an offer stands [s]."""
ANSWERS_PER_S = 20.0
"""Most hellos of one unit that are answered in a second; a unit says ten."""


class ReplayWindow:
    """Sequence numbers that a session has accepted."""

    def __init__(self) -> None:
        self.newest = 0
        self._accepted = _ALL
        """Bit k: the number `newest` - k was accepted; there are none below 1 to miss."""

    def admits(self, sequence: int) -> bool:
        """Return True if a number is new: greater than all, or one of the last 64 that has not been accepted yet."""
        behind = self.newest - sequence
        return behind < 0 or (behind < WIDTH and not self._accepted >> behind & 1)

    def take(self, sequence: int) -> int:
        """Mark an admitted number; return how many older numbers it makes lost."""
        ahead = sequence - self.newest
        if ahead <= 0:
            self._accepted |= 1 << -ahead
            return 0
        self.newest = sequence
        if ahead == 1:
            lost = 1 - (self._accepted >> WIDTH - 1)
        else:
            dropped = min(ahead, WIDTH)
            lost = dropped - (self._accepted >> WIDTH - dropped).bit_count() + ahead - dropped
        self._accepted = (self._accepted << min(ahead, WIDTH) | 1) & _ALL
        return lost

    def missing(self) -> int:
        """Return how many of the last 64 numbers have not come (yet)."""
        return WIDTH - self._accepted.bit_count()


class RateLimiter:
    """Limit on the actions a second; as many are allowed at once."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._spent_to = -math.inf
        """Up to when all that comes in is spent [s]; the last second's is what can be left."""

    def spend(self, now: float) -> bool:
        """Spend one if there is one left at an instant [s]; return whether there was."""
        spent_to = max(self._spent_to, now - 1.0) + 1.0 / self.rate
        if spent_to > now + _ROUNDING_S:
            return False
        self._spent_to = spent_to
        return True


class Session:
    """One challenge of a unit and one nonce of the receiver."""

    def __init__(self, key: Mac, hello: Hello, nonce: bytes, now: float) -> None:
        self.hello, self.nonce = hello, nonce
        self.offered = now
        """Time of the offer [s]."""
        self.mac = session_mac(key, hello.challenge, nonce)
        self.window = ReplayWindow()
        self.number = 0
        """Number of the last beacon."""
        self.sent: dict[int, float] = {}
        """Send times of the last 64 beacons [s], by number."""

    def beacon(self, key: Mac, now: float) -> bytes:
        """Make the next beacon, to be sent at once."""
        self.number += 1
        self.sent[self.number] = now
        self.sent.pop(self.number - _REMEMBERED, None)
        return Beacon(self.hello.unit, self.number, self.nonce).encode(key, self.hello.challenge)


class UnitLink:
    """State of the receiver for the sessions of one unit."""

    def __init__(self, key: bytes, draw: Callable[[int], bytes]) -> None:
        """Begin without a session; `draw` returns random bytes."""
        self._key, self._draw = Mac(key), draw
        self.live: Session | None = None
        self._pending: dict[bytes, Session] = {}
        """Sessions on offer by their challenge, the oldest first."""
        self._answers = RateLimiter(ANSWERS_PER_S)
        self.beacon_due = math.inf
        """Send time of the live session's next beacon [s]; infinite while there is no session."""

    def hello(self, datagram: memoryview, now: float) -> bytes | str:
        """Return the answer to a datagram that looks like a hello, to be sent at once; or why there is none."""
        challenge = bytes(datagram[_CHALLENGE])
        if self.live is not None and challenge == self.live.hello.challenge:
            return "old hello"
        hello = decode_hello(datagram, self._key)
        if hello is None:
            return "tag"
        if not self._answers.spend(now):
            return "too many hellos"
        pending = self._pending
        if challenge not in pending:
            if len(pending) >= PENDING_MOST:
                del pending[next(iter(pending))]
            pending[challenge] = Session(self._key, hello, self._draw(NONCE_SIZE), now)
        return pending[challenge].beacon(self._key, now)

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
        for session in self._pending.values():
            sample = decode_sample(datagram, session.mac) if session.window.admits(sequence) else None
            if sample is not None:
                return session, sample, session.window.take(sequence) + self._go_live(session)
            reason = "tag"
        return reason

    def _go_live(self, session: Session) -> int:
        """Make a session the live one; return how many of the last one's samples never came.

        The unit that took it no longer heeds what was offered before: a sample held back until now must not bring it
        back.
        """
        lost = self.live.window.missing() if self.live else 0
        self.live = session
        offers = list(self._pending.items())
        self._pending = dict(offers[offers.index((session.hello.challenge, session)) + 1 :])
        self.beacon_due = session.sent[session.number] + BEACON_PERIOD_S
        return lost

    def beacon(self, now: float) -> bytes:
        """Return the live session's next beacon, to be sent at once; without a live session there is none."""
        if self.live is None:
            raise RuntimeError("no beacon can be sent to a unit without a session")
        self.beacon_due = now + BEACON_PERIOD_S
        return self.live.beacon(self._key, now)

    def expire(self, now: float) -> None:
        """Drop offers that were not accepted."""
        for challenge, session in list(self._pending.items()):
            if now - session.offered > PENDING_EXPIRY_S:
                del self._pending[challenge]
