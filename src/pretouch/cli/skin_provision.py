"""What `pretouch skin provision` does: a unit at a USB port given its configuration."""

import getpass
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.cli.skin_keys import free_number, keys_file, keys_or_none
from pretouch.errors import HardwareError
from pretouch.extras import UNITS
from pretouch.units.keys import Keys, UnitKey, new_key, save_keys
from pretouch.units.provision import Network, configuration, copy_to_unit, fingerprint

if TYPE_CHECKING:
    from pretouch.cli.skin_commands import Provision


def provision_unit(command: "Provision") -> None:
    """Make a key if the unit has none, and copy it to the unit with the rest of its configuration."""
    place = keys_file(command.keys)
    keys = keys_or_none(place)
    unit = _unit(keys, command.id, command.number, place)
    network = Network(command.ssid, "", command.host, command.port, command.battery_full_mv,
        command.touch_ohm, command.touch_least_mn, command.touch_mn_per_us, command.sensor, command.zones,
    )  # fmt: skip  # what is wrong is said before the password is asked for
    UNITS.need("Provisioning")
    text = configuration(unit, replace(network, password=_password(command)))
    if unit.id not in keys:
        save_keys(Keys([*keys.values(), unit]), place)  # first: a unit with a key that nobody knows is mute
    copy_to_unit(command.device, text)
    print(
        f"{unit.id} is number {unit.number} with the key {fingerprint(unit.key)}..., and sends to"
        f" {network.host}:{network.port}. Its key is in {place}."
    )


def _unit(keys: Keys, name: str, number: int, place: Path) -> UnitKey:
    """Return the unit's entry of the file, or a new one."""
    if name not in keys:
        taken = keys.by_number.get(number)
        if taken is not None:
            raise HardwareError(f"The number {number} belongs to {taken.id} in {place}: give another, or leave it out.")
        return UnitKey(name, number or free_number(keys), new_key())
    if number not in (0, keys[name].number):
        raise HardwareError(
            f"{name} has the number {keys[name].number} in {place}, not {number}: give {keys[name].number}, or leave it"
            " out."
        )
    return keys[name]


def _password(command: "Provision") -> str:
    if not command.password_file:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", getpass.GetPassWarning)
                return getpass.getpass(f"Password of {command.ssid} (empty for an open network): ")
        except (EOFError, getpass.GetPassWarning):
            raise HardwareError("There is no terminal for the password: give a --password-file.") from None
    try:
        lines = Path(command.password_file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise HardwareError(f"The password file {command.password_file} cannot be read: {why}.") from error
    return lines[0] if lines else ""
