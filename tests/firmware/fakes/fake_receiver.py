"""A receiver at the other end of a unit's port that has a network of any mood between."""

import struct

from wire import BEACON_SIZE, Mac, session_mac

SAMPLE = "<2sBBHHIQIIHhHBBHIHHHHBBHII"
FIELDS = (
    "magic", "version", "kind", "unit", "flags", "sequence", "time_us", "beacon", "hold", "battery", "temperature",
    "bus_errors", "stream", "status", "mm", "age", "sigma", "signal", "ambient", "spads", "count", "scale", "rate",
    "index", "imu_age",
)  # fmt: skip


def steps(values):
    """Differences of neighbours."""
    return [values[i + 1] - values[i] for i in range(len(values) - 1)]


class Draw:
    """Random bytes that can be told apart: 0, 1, 2 ... in place of the hardware's."""

    def __init__(self):
        self.drawn = 0

    def __call__(self, size):
        self.drawn += 1
        return bytes([self.drawn & 0xFF] * size)


class FakeReceiver:
    """The port of one unit and the receiver behind it. It keeps the hellos and the samples (dictionaries) it gets."""

    def __init__(self, unit, key):
        self.unit = unit
        self.mac = Mac(key)
        self.inbox = []
        self.hellos = []
        self.samples = []
        self.session = None
        self.number = 0

    def send(self, datagram):
        datagram = bytes(datagram)
        (self._hello if datagram[3] == 1 else self._sample)(datagram)

    def receive(self, buffer):
        if not self.inbox:
            return 0
        datagram = self.inbox.pop(0)[: len(buffer)]
        buffer[: len(datagram)] = datagram
        return len(datagram)

    @property
    def challenge(self):
        return self.hellos[-1][3]

    def beacon(self, number, nonce, challenge, unit=None):
        body = struct.pack("<2sBBHI8s", b"PT", 1, 2, unit or self.unit, number, nonce)
        datagram = body + self.mac.whole(b"PT1BEACN", challenge, body)[:16]
        assert len(datagram) == BEACON_SIZE
        return datagram

    def open(self, nonce=b"nonce..1"):
        """Answer the last hello."""
        self.nonce, self.number = nonce, 0
        self.session = session_mac(self.mac, self.challenge, nonce)
        self._of = self.challenge
        self.go_on()

    def go_on(self):
        """Send the next beacon of the session."""
        self.number += 1
        self.inbox.append(self.beacon(self.number, self.nonce, self._of))

    def _hello(self, datagram):
        _, version, _, unit, firmware, reset, zero, challenge, uptime = struct.unpack("<2sBBHHBB8sQ", datagram[:-16])
        assert (version, unit, zero) == (1, self.unit, 0)
        assert datagram[-16:] == self.mac.whole(b"PT1HELLO", datagram[:-16])[:16]
        self.hellos.append((firmware, reset, uptime, challenge))

    def _sample(self, datagram):
        body = datagram[:-16]
        assert self.session, "a sample without a session"
        assert datagram[-16:] == self.session.whole(body)[:16], "a sample of another session"
        values = struct.unpack_from(SAMPLE, body)
        sample = {FIELDS[i]: values[i] for i in range(len(FIELDS))}
        rest = body[struct.calcsize(SAMPLE) :]
        end = 12 * sample["count"]
        sample["imu"], sample["touch"], sample["zones"] = rest[:end], None, b""
        if sample["flags"] & 128:
            sample["touch"] = struct.unpack("<BBHII", rest[end : end + 12])
            end += 12
        if sample["flags"] & 256:
            sample["zones"] = rest[end:]
            end += 2 + 5 * rest[end] ** 2
        assert len(rest) == end
        assert len(sample["imu"]) == 12 * sample["count"]
        self.samples.append(sample)
