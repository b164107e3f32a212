"""Configuration file of a unit, with its key and receiver, and its transfer to the unit over USB.

MicroPython's own program `mpremote` copies it. No message and no exception here holds a key or a password.
"""

import ipaddress
import json
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

from pretouch.atomic_write import atomic_write
from pretouch.checks import Check, Checked
from pretouch.errors import HardwareError, ParameterError
from pretouch.units import PORT
from pretouch.units.keys import UnitKey

COPY_S = 60.0
"""How long copying may take [s]."""
_SSID_MOST, _PASSWORD_LEAST, _PASSWORD_MOST = 32, 8, 63


@dataclass(frozen=True)
class Network(Checked):
    """Address that a unit sends to, and its sensors; values that no unit can have are refused."""

    ssid: str
    """Name of the Wi-Fi network (2.4 GHz)."""
    host: str
    """IPv4 address of this machine in that network."""
    port: Annotated[int, Check(low=1, high=0xFFFF)] = PORT
    """UDP port of the receiver."""
    battery_full_mv: Annotated[int, Check(low=0, high=20_000)] = 0
    """Battery voltage at the full scale of the unit's converter [mV] (docs/how-to/wiring.md); 0: no battery."""
    touch_ohm: Annotated[int, Check(low=0, high=1_000_000)] = 0
    """Resistor from the touch sensor's pin to ground [ohm] (docs/how-to/wiring.md); 0: no touch sensor."""
    touch_least_mn: Annotated[int, Check(low=1, high=100_000)] = 500
    """Smallest force that counts as a touch [mN]: `force_min_n` of the skin file."""
    touch_mn_per_us: Annotated[int, Check(low=1, high=10_000)] = 10
    """Force by the touch sensor's conductance [mN/uS]: of the FSR 402 about 10, to be calibrated."""
    sensor: Literal["vl53l1x", "vl53l5cx", "vl53l7cx"] = "vl53l1x"
    """Range finder of the unit (docs/how-to/flashing.md); a VL53L1X has no zones."""
    zones: Literal[4, 8] = 4
    """Zones along each side of its range finder, if it has some."""

    def __post_init__(self) -> None:
        try:
            super().__post_init__()
        except ParameterError as error:  # of which a command line makes more than a sentence
            raise HardwareError(str(error)) from None
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


def configuration(key: UnitKey, network: Network, password: str) -> str:
    """Return the text of a unit's configuration file, JSON on one line; an empty password is of an open network."""
    size = _size(password, "password")
    if (size and not _PASSWORD_LEAST <= size <= _PASSWORD_MOST) or "\0" in password:
        raise HardwareError(
            f"The password has {size} bytes: give {_PASSWORD_LEAST} to {_PASSWORD_MOST} for WPA, or leave it empty for"
            " an open network."
        )
    values = {"unit": key.number, "key": key.key.hex(), **asdict(network), "password": password}
    if network.sensor == "vl53l1x":
        values["zones"] = 1
    return json.dumps(values, ensure_ascii=False) + "\n"  # units join no halves of \u escapes


def copy_to_unit(device: str, text: str, timeout: float = COPY_S) -> None:
    """Write a configuration to the unit at a serial device and restart it; a failure is a HardwareError."""
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
