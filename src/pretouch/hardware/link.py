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
    TAKES_TOUCH,
    TAKES_ZONES,
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
_CHALLENGES = 256
"""Of one unit, that are remembered as answered."""
_IN_VAIN = 5
"""Answers to a challenge after which it comes last, unless its unit takes one."""
_ROUNDING_S = 1e-9


@dataclass(frozen=True)
class LinkParams(Checked):
    """How a receiver treats its units."""

    beacon_period_s: Positive = 0.25
    """Time between the beacons to a unit [s]. Without one for 2 s it leaves the session (docs/reference/wire.md). Where
    30 % are lost, that happens once in an hour and a half with eight in that time, and every minute and a half with
    four."""
    pending_most: PositiveCount = 4
    """Most sessions offered to one unit at once."""
    pending_expiry_s: Positive = 5.0
    """How long an offer stands after the last hello that asked for it [s]."""
    pending_longest_s: Positive = 30.0
    """How long an offer stands at most [s], however often it is asked for: recorded hellos must not keep it."""
    answers_per_s: Annotated[float, Check(low=1.0)] = 20.0
    """Most hellos of one unit that are answered in a second; a unit says ten."""
    tries_per_s: Annotated[float, Check(low=1.0)] = 200.0
    """Most samples of one unit that are tried against its offers in a second, so that offers nobody takes do not make
    a flood of forged samples five times as dear; a unit sends fifty."""
    samples_per_s: Annotated[float, Check(low=1.0)] = 200.0
    """Most genuine samples of one unit that are taken in a second, so that the holder of one key costs no more than
    four units; a unit sends fifty, and no more than a hundred."""
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


class ReplayWindow:
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


class RateLimiter:
    """So many a second, and as many at once."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._spent_to = -math.inf
        """Up to when all that comes in is spent [s]; the last second's is what can be left."""

    def left(self, now: float) -> float:
        """Return how many are left at an instant [s]."""
        return self.rate * min(now - self._spent_to, 1.0)

    def spend(self, now: float) -> bool:
        """Spend one if there is one; return whether there was."""
        spent_to = max(self._spent_to, now - 1.0) + 1.0 / self.rate
        if spent_to > now + _ROUNDING_S:
            return False
        self._spent_to = spent_to
        return True


class AnsweredChallenges:
    """How often challenges were answered without being taken: those of recorded hellos, answered in vain, come last."""

    def __init__(self) -> None:
        self._answers: dict[bytes, tuple[int, float]] = {}

    def answers(self, challenge: bytes) -> tuple[int, float]:
        """Return how often a challenge was answered, and when last [s]."""
        return self._answers.get(challenge, (0, -math.inf))

    def exhausted(self, challenge: bytes) -> bool:
        """Whether a challenge was answered so often in vain that its unit hardly waits for another answer."""
        return self.answers(challenge)[0] >= _IN_VAIN

    def add(self, challenge: bytes, now: float, times: int = 1) -> None:
        """Count an answer; the challenge answered longest ago makes room."""
        count = self.answers(challenge)[0] + times
        self._answers.pop(challenge, None)
        self._answers[challenge] = count, now
        if len(self._answers) > _CHALLENGES:
            del self._answers[next(iter(self._answers))]

    def __len__(self) -> int:
        return len(self._answers)


class Session:
    """One challenge of a unit and one nonce of the receiver."""

    def __init__(self, key: Mac, hello: Hello, nonce: bytes, now: float, index: int, zones: bool) -> None:
        self.hello, self.nonce, self._zones = hello, nonce, zones
        self.index = index
        """Its place in the order in which the unit's sessions were offered."""
        self.offered = self.asked = now
        """When it was offered, and asked for last [s]."""
        self.mac = session_mac(key, hello.challenge, nonce)
        self.window = ReplayWindow()
        self.number = 0
        """Of the last beacon."""
        self.sent: dict[int, float] = {}
        """When the last 64 beacons were sent [s]."""

    def beacon(self, key: Mac, now: float) -> bytes:
        """Make the next beacon, to be sent at once."""
        self.number += 1
        self.sent[self.number] = now
        self.sent.pop(self.number - _REMEMBERED, None)
        takes = TAKES_TOUCH | (TAKES_ZONES if self._zones else 0)
        return Beacon(self.hello.unit, self.number, self.nonce, takes).encode(key, self.hello.challenge)


class Link:
    """What the receiver knows of one unit's sessions."""

    def __init__(self, key: bytes, params: LinkParams, draw: Callable[[int], bytes], zones: bool = False) -> None:
        """Know of no session; `draw` gives so many random bytes. With `zones`, samples may carry those."""
        self._zones = zones
        self._key, self._params, self._draw = Mac(key), params, draw
        self.live: Session | None = None
        self._pending: dict[bytes, Session] = {}
        self._offers = 0
        self._answers, self._tries = RateLimiter(params.answers_per_s), RateLimiter(params.tries_per_s)
        self._samples = RateLimiter(params.samples_per_s)
        self._answered = AnsweredChallenges()
        self.beacon_due = math.inf
        """When the live session's next beacon is to be sent [s]; never while there is none."""

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
        session = self._pending.get(challenge) or self._offer(hello, now)
        if session is None:
            return "too many hellos"
        session.asked = now
        self._answers.spend(now)
        self._answered.add(challenge, now)
        return session.beacon(self._key, now)

    def _offer(self, hello: Hello, now: float) -> Session | None:
        """Offer a session, in the place of the oldest if there are enough; None if others go before."""
        pending = self._pending
        if len(pending) >= self._params.pending_most:
            exhausted = next((challenge for challenge in pending if self._answered.exhausted(challenge)), None)
            if exhausted is None and self._answered.exhausted(hello.challenge):
                return None
            del pending[next(iter(pending)) if exhausted is None else exhausted]
        self._offers += 1
        pending[hello.challenge] = Session(self._key, hello, self._draw(NONCE_SIZE), now, self._offers, self._zones)
        return pending[hello.challenge]

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
                if not self._samples.spend(now):
                    return "too fast"
                return self.live, sample, self.live.window.take(sequence)
            reason = "tag"
        if self._pending and not self._tries.spend(now):
            return "too many samples"
        for session in self._pending.values():
            sample = decode_sample(datagram, session.mac) if session.window.admits(sequence) else None
            if sample is not None:
                return session, sample, session.window.take(sequence) + self._go_live(session, now)
            reason = "tag"
        return reason

    def _go_live(self, session: Session, now: float) -> int:
        """Let a session be the live one; return how many of the last one's samples never came.

        The unit that took it no longer heeds what was offered before: a sample held back until now must not bring it
        back.
        """
        given_up = self.live.window.missing() if self.live else 0
        self.live = session
        self._pending = {c: s for c, s in self._pending.items() if s.index > session.index}
        self._answered.add(session.hello.challenge, now, _IN_VAIN)
        self.beacon_due = session.sent[session.number] + self._params.beacon_period_s
        return given_up

    def beacon(self, now: float) -> bytes:
        """Return the live session's next beacon, to be sent at once; without a live session there is none."""
        if self.live is None:
            raise RuntimeError("no beacon can be sent to a unit without a session")
        self.beacon_due = now + self._params.beacon_period_s
        return self.live.beacon(self._key, now)

    def forget_offers(self) -> None:
        """Take back what is offered."""
        self._pending.clear()

    def expire(self, now: float) -> None:
        """Forget offers that were not taken."""
        if not self._pending:
            return
        expiry, longest = self._params.pending_expiry_s, self._params.pending_longest_s
        for challenge, session in list(self._pending.items()):
            if now - session.asked > expiry or now - session.offered > longest:
                del self._pending[challenge]

    def _affordable(self, challenge: bytes, now: float) -> bool:
        """Whether a challenge may have an answer.

        While answers are scarce it gets one a second, and none after five that its unit did not take: so recorded
        hellos, sent again and again, do not use up the answers that a unit needs.
        """
        left = self._answers.left(now)
        if left >= 0.5 * self._answers.rate:
            return True
        count, last = self._answered.answers(challenge)
        return left >= 1.0 - _ROUNDING_S and count < _IN_VAIN and now - last >= 1.0
