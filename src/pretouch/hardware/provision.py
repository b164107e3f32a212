"""Telling a unit over USB who it is, its key, and where it sends, by one JSON line (docs/how-to/flashing.md).

No message and no exception here holds a key or a password.
"""

import ipaddress
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Protocol

from pretouch.errors import HardwareError
from pretouch.hardware.keys import UnitKey

_PROTOCOL = 1
GREET_S = 15.0
"""How long a unit is asked who it is [s]: it begins anew when its line is opened, and takes some seconds for that."""
ANSWER_S = 5.0
"""How long it may take to store what it is told [s]."""
_ASK_EVERY_S = 1.0
_QUIET_S = 0.3
_LONGEST = 1 << 16
_PIECE, _PAUSE_S = 32, 0.01
"""Bytes sent at once, and the pause after them [s]: a unit takes in few before it reads them."""
_FULL_MOST_MV = 20_000
_NO_HOSTS, _FIRST_MULTICAST = (0, 127), 224
"""First numbers of IPv4 addresses that are no host a unit could send to; multicast and broadcast are the upper ones."""
_SSID_MOST, _PASSWORD_LEAST, _PASSWORD_MOST = 32, 8, 63


class Line(Protocol):
    """A serial line."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send bytes within a time [s]."""
        ...

    def read(self, timeout: float) -> bytes:
        """Return what has come, b'' if nothing comes within a time [s]."""
        ...


SENSORS = ("vl53l1x", "vl53l5cx", "vl53l7cx")
"""Range finders that the firmware knows; the first has no zones."""


@dataclass(frozen=True)
class Network:
    """Where a unit sends: what cannot be is a HardwareError."""

    ssid: str
    password: str
    host: str
    """IPv4 address of the receiver in the unit's network."""
    port: int
    battery_full_mv: int = 0
    """Voltage of the unit's battery that fills its converter [mV] (docs/how-to/wiring.md); 0: none is wired to it."""
    touch_ohm: int = 0
    """Resistor from the touch sensor's pin to ground [ohm] (docs/how-to/wiring.md); 0: it has no such sensor."""
    touch_least_mn: int = 500
    """Smallest force that is a touch [mN]."""
    touch_mn_per_us: int = 10
    """Force by the touch sensor's conductance [mN/uS]: of the FSR 402 about 10, to be calibrated."""
    sensor: str = "vl53l1x"
    """Range finder of the unit: one of `SENSORS`."""
    zones: int = 4
    """Zones along each side of its range finder, 4 or 8, if it has some."""

    def __post_init__(self) -> None:
        if not 1 <= _size(self.ssid, "network's name") <= _SSID_MOST or "\0" in self.ssid:
            raise HardwareError(f"The network's name {self.ssid!r} is not valid: give 1 to {_SSID_MOST} bytes.")
        size = _size(self.password, "password")
        if (size and not _PASSWORD_LEAST <= size <= _PASSWORD_MOST) or "\0" in self.password:
            raise HardwareError(
                f"The password has {size} bytes: give {_PASSWORD_LEAST} to {_PASSWORD_MOST} for WPA, or leave it empty"
                " for an open network."
            )
        try:
            address = ipaddress.IPv4Address(self.host)
        except ValueError:
            raise HardwareError(
                f"The host {self.host!r} is not an IPv4 address: give one such as 192.168.1.10."
            ) from None
        if address.packed[0] in _NO_HOSTS or address.packed[0] >= _FIRST_MULTICAST:
            raise HardwareError(
                f"A unit cannot send to {self.host}: give the address this machine has in the unit's network."
            )
        if not 1 <= self.port <= 0xFFFF:
            raise HardwareError(f"The port is {self.port}: give one from 1 to 65535.")
        if not 0 <= self.battery_full_mv <= _FULL_MOST_MV:
            raise HardwareError(
                f"The battery voltage at the converter's full scale is {self.battery_full_mv} mV: give 0 to"
                f" {_FULL_MOST_MV}, for example 5000."
            )
        if self.sensor not in SENSORS or self.zones not in (4, 8):
            raise HardwareError(
                f"The unit's sensor is {self.sensor!r} with {self.zones} zones along a side: choose from"
                f" {', '.join(SENSORS)}, and 4 or 8."
            )
        limits = {"touch_ohm": (0, 1_000_000), "touch_least_mn": (1, 100_000), "touch_mn_per_us": (1, 10_000)}
        for name, (least, most) in limits.items():
            if not least <= getattr(self, name) <= most:
                raise HardwareError(f"The unit's {name} is {getattr(self, name)}: give {least} to {most}.")

    def __repr__(self) -> str:
        """Without the password."""
        return f"Network(ssid={self.ssid!r}, host={self.host!r}, port={self.port})"


@dataclass(frozen=True)
class Peer:
    """Who a unit says it is."""

    unit: int | None
    """Its number, None of one that was never told."""
    fingerprint: str | None
    """Of its key."""
    firmware: str
    board: str


def fingerprint(key: bytes) -> str:
    """Return what tells keys apart without showing them: the first 8 hex digits of the SHA-256."""
    return sha256(key).hexdigest()[:8]


def greet(line: Line, timeout: float = GREET_S) -> Peer:
    """Ask who is at the other end, again and again; nobody within a time [s] is a HardwareError."""
    until = time.monotonic() + timeout
    answers = _Answers(line)
    while (now := time.monotonic()) < until:
        line.write(b'\n{"pretouch": "hello"}\n', timeout=ANSWER_S)
        for answer in answers.until(min(until, now + _ASK_EVERY_S)):
            if answer.get("ok") is True:  # a refusal is of a line that boot messages had spoilt
                answers.drain(_QUIET_S)
                return _peer(answer)
    if answers.rubbish:
        raise HardwareError(
            f"Something answers that is not a Pretouch unit ({_shown(answers.rubbish)}): flash the firmware first, and"
            " check that nothing else uses the line."
        )
    raise HardwareError(
        f"Nothing answers within {timeout:g} s: press the unit's reset button and try again; if it still does not"
        " answer, flash the firmware."
    )


def provision(line: Line, key: UnitKey, network: Network, timeout: float = ANSWER_S) -> Peer:
    """Tell a unit who it is; return what it then says it is. Refusals and wrong answers are a HardwareError."""
    told: dict[str, int | str] = {
        "pretouch": _PROTOCOL, "unit": key.number, "key": key.key.hex(), "ssid": network.ssid,
        "password": network.password, "host": network.host, "port": network.port,
        "battery_full_mv": network.battery_full_mv,
    }  # fmt: skip
    if network.sensor != SENSORS[0]:
        told |= {"sensor": network.sensor, "zones": network.zones}
    if network.touch_ohm:
        told |= {name: getattr(network, name) for name in ("touch_ohm", "touch_least_mn", "touch_mn_per_us")}
    data = json.dumps(told, ensure_ascii=False).encode() + b"\n"  # units join no halves of \u escapes
    for start in range(0, len(data), _PIECE):
        line.write(data[start : start + _PIECE], timeout)
        time.sleep(_PAUSE_S)
    for answer in _Answers(line).until(time.monotonic() + timeout):
        if answer.get("ok") is not True:
            why = str(answer.get("error"))
            for secret in (told["key"], network.password):
                why = why.replace(str(secret), "***") if secret else why
            raise HardwareError(f"The unit refuses: {_shown(why.encode())}.")
        peer = _peer(answer)
        if (peer.unit, peer.fingerprint) != (key.number, fingerprint(key.key)):
            raise HardwareError(
                f"The unit says it is number {peer.unit} with the key {peer.fingerprint}, but should be {key.number}"
                f" with {fingerprint(key.key)}: press its reset button and try again."
            )
        return peer
    raise HardwareError(f"The unit does not answer within {timeout:g} s: press its reset button and try again.")


def differs(peer: Peer, key: UnitKey) -> str:
    """Say in what a unit that was told before is another than it shall be, or ''."""
    if peer.unit is None or (peer.unit, peer.fingerprint) == (key.number, fingerprint(key.key)):
        return ""
    if peer.unit != key.number:
        return f"it is number {peer.unit}, not {key.number}"
    return f"it is number {peer.unit} with another key ({peer.fingerprint}, not {fingerprint(key.key)})"


class _Answers:
    """JSON objects with `ok` among whatever comes on a line."""

    def __init__(self, line: Line) -> None:
        self._line, self._rest = line, b""
        self.rubbish = b""
        """The last bytes that were no answer."""

    def until(self, instant: float) -> Iterator[dict[str, Any]]:
        """Yield answers that come before an instant [s]."""
        while (left := instant - time.monotonic()) > 0:
            self._rest = (self._rest + self._line.read(left))[-_LONGEST:]
            *lines, self._rest = self._rest.split(b"\n")
            for text in lines:
                answer = _answer(text)
                if answer is not None:
                    yield answer
                elif text.strip():
                    self.rubbish = text.strip()

    def drain(self, quiet: float) -> None:
        """Wait until nothing more comes for a time [s]; no longer than for an answer."""
        until = time.monotonic() + ANSWER_S
        while self._line.read(quiet) and time.monotonic() < until:
            pass
        self._rest = b""


def _answer(text: bytes) -> dict[str, Any] | None:
    """Return an answer, with boot messages before it cut off."""
    try:
        found = json.loads(text[text.index(b"{") :])
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and isinstance(found.get("ok"), bool) else None


def _peer(answer: dict[str, Any]) -> Peer:
    unit, key = answer.get("unit"), answer.get("fingerprint")
    return Peer(
        unit if type(unit) is int else None,
        key if isinstance(key, str) else None,
        _text(answer.get("firmware")),
        _text(answer.get("board")),
    )


def _text(value: object) -> str:
    return _shown(str(value).encode()) if value is not None else "unknown"


def _size(text: str, name: str) -> int:
    """Return the bytes of a text; one that is no Unicode text is a HardwareError."""
    try:
        return len(text.encode())
    except UnicodeEncodeError:
        raise HardwareError(f"The {name} is not Unicode text: give it in UTF-8.") from None


def _shown(data: bytes) -> str:
    text = data.decode(errors="replace")[:80]
    return "".join(c if c.isprintable() else "?" for c in text)
