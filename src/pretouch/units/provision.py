"""A unit's configuration file, with its key and where it sends, and putting it on the unit over USB.

MicroPython's own program `mpremote` copies it. No message and no exception here holds a key or a password.
"""

import ipaddress
import json
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from pretouch.atomic_write import atomic_write
from pretouch.errors import HardwareError
from pretouch.units import PORT
from pretouch.units.keys import UnitKey

COPY_S = 60.0
"""How long copying may take [s]."""
_SSID_MOST, _PASSWORD_LEAST, _PASSWORD_MOST = 32, 8, 63
SENSORS = ("vl53l1x", "vl53l5cx", "vl53l7cx")
"""Range finders that the firmware knows; the first has no zones."""
_LIMITS = {
    "port": (1, 0xFFFF),
    "battery_full_mv": (0, 20_000),
    "touch_ohm": (0, 1_000_000),
    "touch_least_mn": (1, 100_000),
    "touch_mn_per_us": (1, 10_000),
}
"""Least and most of what is a number."""


@dataclass(frozen=True)
class Network:
    """Where a unit sends, and what it carries; values that no unit can have are refused."""

    ssid: str
    """Name of the Wi-Fi network (2.4 GHz)."""
    host: str
    """IPv4 address of this machine in that network."""
    port: int = PORT
    """UDP port of the receiver."""
    battery_full_mv: int = 0
    """Battery voltage at the full scale of the unit's converter [mV] (docs/how-to/wiring.md); 0: no battery."""
    touch_ohm: int = 0
    """Resistor from the touch sensor's pin to ground [ohm] (docs/how-to/wiring.md); 0: no touch sensor."""
    touch_least_mn: int = 500
    """Smallest force that counts as a touch [mN]: `force_min_n` of the skin file."""
    touch_mn_per_us: int = 10
    """Force by the touch sensor's conductance [mN/uS]: of the FSR 402 about 10, to be calibrated."""
    sensor: str = SENSORS[0]
    """Range finder of the unit: vl53l1x, vl53l5cx or vl53l7cx (docs/how-to/flashing.md)."""
    zones: int = 4
    """Zones along each side of its range finder, 4 or 8, if it has some."""

    def __post_init__(self) -> None:
        if not 1 <= _size(self.ssid, "network's name") <= _SSID_MOST or "\0" in self.ssid:
            raise HardwareError(f"The network's name {self.ssid!r} is not valid: give 1 to {_SSID_MOST} bytes.")
        try:
            address = ipaddress.IPv4Address(self.host)
        except ValueError:
            raise HardwareError(
                f"The host {self.host!r} is not an IPv4 address: give one such as 192.168.1.10."
            ) from None
        if address.packed[0] in (0, 127) or address.packed[0] >= 224:  # this host itself; multicast and broadcast
            raise HardwareError(
                f"A unit cannot send to {self.host}: give the address this machine has in the unit's network."
            )
        if self.sensor not in SENSORS or self.zones not in (4, 8):
            raise HardwareError(
                f"The unit's sensor is {self.sensor!r} with {self.zones} zones along a side: choose from"
                f" {', '.join(SENSORS)}, and 4 or 8."
            )
        for name, (least, most) in _LIMITS.items():
            if not least <= getattr(self, name) <= most:
                raise HardwareError(f"The unit's {name} is {getattr(self, name)}: give {least} to {most}.")


def configuration(key: UnitKey, network: Network, password: str) -> str:
    """Return the text of a unit's configuration file, JSON on one line; an empty password is of an open network."""
    size = _size(password, "password")
    if (size and not _PASSWORD_LEAST <= size <= _PASSWORD_MOST) or "\0" in password:
        raise HardwareError(
            f"The password has {size} bytes: give {_PASSWORD_LEAST} to {_PASSWORD_MOST} for WPA, or leave it empty for"
            " an open network."
        )
    values = {"unit": key.number, "key": key.key.hex(), **asdict(network), "password": password}
    if network.sensor == SENSORS[0]:
        values["zones"] = 1
    return json.dumps(values, ensure_ascii=False) + "\n"  # units join no halves of \u escapes


def copy_to_unit(device: str, text: str, timeout: float = COPY_S) -> None:
    """Put a configuration on the unit at a serial device, and have it begin anew; what fails is a HardwareError."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "config.json"
        atomic_write(file, text, private=True)
        command = "connect", device, "cp", str(file), ":config.json", "+", "reset"
        try:
            copied = subprocess.run(  # noqa: S603  # by words, no shell
                [sys.executable, "-m", "mpremote", *command], capture_output=True, text=True, timeout=timeout
            )
        except subprocess.TimeoutExpired:
            raise HardwareError(
                f"The unit at {device} did not answer within {timeout:g} s: press its reset button and try again."
            ) from None
    if copied.returncode:
        lines = (copied.stderr or copied.stdout).split("\n")
        reason = next((line.strip() for line in reversed(lines) if line.strip()), f"code {copied.returncode}")
        printable = "".join(c if c.isprintable() else "?" for c in reason[:120])
        raise HardwareError(
            f"mpremote could not write to the unit at {device} ({printable}): start the command within 3 s"
            " after its reset button, and see that nothing else uses the line."
        )


def _size(text: str, name: str) -> int:
    """Return the bytes of a text; one that is no Unicode text is a HardwareError."""
    try:
        return len(text.encode())
    except UnicodeEncodeError:
        raise HardwareError(f"The {name} is not Unicode text: give it in UTF-8.") from None
