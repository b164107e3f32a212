"""`pretouch skin keys` and `skin provision`: the keys of units, and a unit at a USB port given its configuration."""

import getpass
import warnings
from dataclasses import dataclass
from pathlib import Path

from pretouch.cli.options import JsonFile, OptionalFile, Words
from pretouch.cli.writing import numbers_to
from pretouch.errors import HardwareError
from pretouch.extras import UNITS
from pretouch.units.keys import Keys, UnitKey, load_keys, new_key, save_keys
from pretouch.units.provision import Network, configuration, copy_to_unit


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
