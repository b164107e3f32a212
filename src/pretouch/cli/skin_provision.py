"""What `pretouch skin provision` does: a unit at a USB port given its configuration."""

import getpass
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

from pretouch.cli.options import OptionalFile
from pretouch.cli.skin_keys import keys_or_none
from pretouch.errors import HardwareError
from pretouch.extras import UNITS
from pretouch.units import PORT
from pretouch.units.keys import Keys, UnitKey, new_key, save_keys
from pretouch.units.provision import Network, configuration, copy_to_unit


@dataclass(frozen=True)
class Provision:
    """Set up a unit over USB: its number, its own random key, your Wi-Fi, and the receiver's address.

    The password is asked for, and shown nowhere.
    """

    id: str
    """Name of the unit, as in the skin file."""
    keys: Path
    """File of the units' keys; created if it is missing, readable only by you."""
    ssid: str
    """Name of the Wi-Fi network (2.4 GHz)."""
    host: str
    """IPv4 address of this machine in that network."""
    number: int = 0
    """Number of the unit in datagrams, 1 to 65535; by default that in the file of keys, or the first free one."""
    device: str = "/dev/ttyUSB0"
    """Serial device of the unit."""
    port: int = PORT
    """UDP port of the receiver."""
    battery_full_mv: int = 0
    """Battery voltage at the full scale of the unit's converter [mV] (docs/how-to/wiring.md); 0: no battery."""
    sensor: str = "vl53l1x"
    """Range finder of the unit: vl53l1x, vl53l5cx or vl53l7cx (docs/how-to/flashing.md)."""
    zones: int = 4
    """Zones along each side of its range finder, 4 or 8, if it has some."""
    touch_ohm: int = 0
    """Resistor from the touch sensor's pin to ground [ohm] (docs/how-to/wiring.md); 0: no touch sensor."""
    touch_least_mn: int = 500
    """Smallest force that counts as a touch [mN]: `force_min_n` of the skin file."""
    touch_mn_per_us: int = 10
    """Force by the touch sensor's conductance [mN/uS], as calibrated."""
    password_file: OptionalFile = None
    """File whose first line is the Wi-Fi password, instead of typing it."""

    def run(self) -> None:
        """Make a key if the unit has none, and copy it to the unit with the rest of its configuration."""
        keys = keys_or_none(self.keys)
        unit = _unit(keys, self.id, self.number, self.keys)
        # what is wrong is said before the password is asked for
        touch = self.touch_ohm, self.touch_least_mn, self.touch_mn_per_us
        place = self.ssid, "", self.host, self.port
        network = Network(*place, self.battery_full_mv, *touch, self.sensor, self.zones)
        UNITS.need("Provisioning")
        text = configuration(unit, replace(network, password=_password(self)))
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
                return getpass.getpass(f"Password of {command.ssid} (empty for an open network): ")
        except (EOFError, getpass.GetPassWarning):
            raise HardwareError("There is no terminal for the password: give a --password-file.") from None
    try:
        lines = command.password_file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise HardwareError(f"The password file {command.password_file} cannot be read: {why}.") from error
    return lines[0] if lines else ""
