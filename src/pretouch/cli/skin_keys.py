"""`pretouch skin keys` and `skin provision`: the keys of units, and a unit at a USB port given its configuration.

MicroPython's own program `mpremote` copies that. No message and no exception here holds a key or a password.
"""

import getpass
import ipaddress
import json
import subprocess
import sys
import tempfile
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

from pretouch.atomic_write import atomic_write
from pretouch.checks import Check, Checked
from pretouch.cli.options import JsonFile, OptionalFile, Words
from pretouch.cli.writing import numbers_to
from pretouch.errors import HardwareError, ParameterError
from pretouch.extras import UNITS
from pretouch.units import PORT
from pretouch.units.keys import Keys, UnitKey, load_keys, new_key, save_keys

COPY_S = 60.0
"""How long copying may take [s]."""
_SSID_MOST, _PASSWORD_LEAST, _PASSWORD_MOST = 32, 8, 63


@dataclass(frozen=True)
class ListKeys:
    """List the units of a file of keys, add some with random keys to try `simulate` and `monitor`, or revoke keys."""

    keys: Path
    """File of the units' keys; created if it is missing, readable only by you."""
    new: Words = ()
    """Names of units to add, separated by commas."""
    revoke: Words = ()
    """Names of units whose keys no longer count, separated by commas: lost or stolen. The others keep theirs."""
    json: JsonFile = None

    def run(self) -> None:
        """Print name, number and fingerprint of each unit, after revoking keys and adding names."""
        with numbers_to(self.json) as write:
            keys = keys_or_none(self.keys) if self.new and not self.revoke else load_keys(self.keys)
            if self.new or self.revoke:
                keys = keys.without(self.revoke).with_new(self.new)
                save_keys(keys, self.keys)
            if self.revoke:
                names = ", ".join(self.revoke)
                print(f"Revoked: {names}. A receiver that runs goes on with the keys it has read: start it anew.")
            units = [{"unit": u.id, "number": u.number, "fingerprint": u.fingerprint} for u in keys.values()]
            for unit in units:
                print("{unit}: number {number}, key {fingerprint}...".format(**unit))
            write({"units": units})


def keys_or_none(place: Path) -> Keys:
    """Read a file of keys; one that is not there holds none."""
    return load_keys(place) if place.exists() else Keys()


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


@dataclass(frozen=True)
class Provision:
    """Set up a unit over USB: its number, its own random key, your Wi-Fi, and the receiver's address.

    The password is asked for, and shown nowhere.
    """

    id: str
    """Name of the unit, as in the skin file."""
    keys: Path
    """File of the units' keys; created if it is missing, readable only by you."""
    network: Network
    number: int = 0
    """Number of the unit in datagrams, 1 to 65535; by default that in the file of keys, or the first free one."""
    device: str = "/dev/ttyUSB0"
    """Serial device of the unit."""
    password_file: OptionalFile = None
    """File whose first line is the Wi-Fi password, instead of typing it."""

    def run(self) -> None:
        """Make a key if the unit has none, and copy it to the unit with the rest of its configuration."""
        keys, network = keys_or_none(self.keys), self.network
        unit = _unit(keys, self.id, self.number, self.keys)
        UNITS.need("Provisioning")
        text = configuration(unit, network, _password(self))
        if unit.id not in keys:
            save_keys(Keys([*keys.values(), unit]), self.keys)  # first: a unit with a key that nobody knows is mute
        copy_to_unit(self.device, text)
        print(
            f"{unit.id} is number {unit.number} with the key {unit.fingerprint}..., and sends to"
            f" {network.host}:{network.port}. Its key is in {self.keys}."
        )


def _unit(keys: Keys, name: str, number: int, place: Path) -> UnitKey:
    """Return the unit's entry of the file, or a new one."""
    if name not in keys:
        other = keys.by_number.get(number)
        if other is not None:
            raise HardwareError(f"The number {number} belongs to {other.id} in {place}: give another, or leave it out.")
        return UnitKey(name, number or keys.free_number, new_key())
    if number not in (0, keys[name].number):
        raise HardwareError(
            f"{name} has the number {keys[name].number} in {place}, not {number}: give {keys[name].number}, or leave it"
            " out."
        )
    return keys[name]


def _password(command: Provision) -> str:
    if not command.password_file:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", getpass.GetPassWarning)
                return getpass.getpass(f"Password of {command.network.ssid} (empty for an open network): ")
        except (EOFError, getpass.GetPassWarning):
            raise HardwareError("There is no terminal for the password: give a --password-file.") from None
    try:
        lines = command.password_file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise HardwareError(f"The password file {command.password_file} cannot be read: {why}.") from error
    return lines[0] if lines else ""


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
