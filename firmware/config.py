"""What a unit is told once and keeps: who it is, its key, its network, its receiver. Checked, stored, read back.

The file is one line of JSON and one with the SHA-256 of the first, so that a torn file is known as such. It is written
beside the old one and then takes its place: power lost at any moment leaves the old one or the new one.
"""

import hashlib
import json
import os
from binascii import hexlify, unhexlify

PATH = "config.json"
KEY_SIZE = 32
_KEPT = ("unit", "ssid", "password", "host", "port", "battery_full_mv")
_SENSOR = ("sensor", "zones")
"""Of a unit with a range finder other than the VL53L1X."""
SENSORS = ("vl53l1x", "vl53l5cx", "vl53l7cx")
_TOUCH = ("touch_ohm", "touch_least_mn", "touch_mn_per_us")
"""Of a unit with a touch sensor: see docs/how-to/wiring.md."""


class ConfigError(Exception):
    """A configuration is missing, torn or wrong; the text says what and never holds a secret."""


def _whole(line, name, least, most):
    value = line.get(name)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise ConfigError(f"{name} must be a whole number from {least} to {most}")
    return value


def _text(line, name, least, most):
    value = line.get(name)
    good = isinstance(value, str) and not any(c == "\0" or 0xD800 <= ord(c) < 0xE000 for c in value)
    if not good or not least <= len(value.encode()) <= most:
        raise ConfigError(f"{name} must be text of {least} to {most} bytes")
    return value


def _key(line):
    text = line.get("key")
    if isinstance(text, str) and len(text) == 2 * KEY_SIZE and all(c in "0123456789abcdefABCDEF" for c in text):
        return text.lower()
    raise ConfigError(f"key must be {2 * KEY_SIZE} hex digits")


def _host(line):
    value = line.get("host")
    parts = value.split(".") if isinstance(value, str) else ()
    numbers = [int(p) if 0 < len(p) < 4 and all(c in "0123456789" for c in p) else 256 for p in parts]
    well = len(parts) == 4 and max(numbers) < 256 and value == ".".join(map(str, numbers))
    if not well or not 0 < numbers[0] < 224 or numbers[0] == 127:
        raise ConfigError("host must be an IPv4 address such as 192.168.1.10")
    return value


def _password(line):
    value = _text(line, "password", 0, 63)
    if 0 < len(value.encode()) < 8:
        raise ConfigError("password must be empty, or text of 8 to 63 bytes")
    return value


class Config:
    """A checked configuration, from a dictionary as the serial line or the file has it; else `ConfigError`."""

    def __init__(self, line):
        self.unit = _whole(line, "unit", 1, 65535)
        self._hex = _key(line)
        self.ssid = _text(line, "ssid", 1, 32)
        self.password = _password(line)
        self.host = _host(line)
        self.port = _whole(line, "port", 1, 65535)
        self.battery_full_mv = _whole(line, "battery_full_mv", 0, 20000) if "battery_full_mv" in line else 0
        self.touch_ohm = _whole(line, "touch_ohm", 0, 1_000_000) if "touch_ohm" in line else 0
        self.touch_least_mn = self.touch_mn_per_us = 0
        if self.touch_ohm:
            self.touch_least_mn = _whole(line, "touch_least_mn", 1, 100_000)
            self.touch_mn_per_us = _whole(line, "touch_mn_per_us", 1, 10_000)
        self.sensor = line.get("sensor", SENSORS[0])
        if self.sensor not in SENSORS:
            raise ConfigError("sensor must be one of " + ", ".join(SENSORS))
        self.zones = 1
        if self.sensor != SENSORS[0]:
            self.zones = _whole(line, "zones", 4, 8)
            if self.zones not in (4, 8):
                raise ConfigError("zones must be 4 or 8")

    @property
    def key(self):
        """The unit's key, 32 bytes."""
        return unhexlify(self._hex)

    @property
    def fingerprint(self):
        """The first 8 hex digits of the key's SHA-256, to tell keys apart without showing them."""
        return hexlify(hashlib.sha256(self.key).digest()[:4]).decode()

    def save(self, path=PATH):
        """Replace the stored configuration."""
        fields = {name: getattr(self, name) for name in _KEPT}
        if self.touch_ohm:
            fields.update({name: getattr(self, name) for name in _TOUCH})
        if self.zones > 1:
            fields.update({name: getattr(self, name) for name in _SENSOR})
        fields["key"] = self._hex
        text = json.dumps(fields)
        with open(path + ".new", "w") as file:
            file.write(text + "\n" + _sum(text) + "\n")
        os.rename(path + ".new", path)


def load(path=PATH):
    """Return the stored configuration; `ConfigError` if there is none or it cannot be trusted."""
    try:
        with open(path) as file:
            text, total, rest = (file.read() + "\n\n").split("\n", 2)
    except OSError:
        raise ConfigError("there is no configuration") from None
    except (UnicodeError, ValueError):
        raise ConfigError("the configuration is torn") from None
    if rest != "\n\n" or total != _sum(text):
        raise ConfigError("the configuration is torn")
    try:
        line = json.loads(text)
    except ValueError:
        line = None
    if not isinstance(line, dict):
        raise ConfigError("the configuration is no JSON object")
    return Config(line)


def _sum(text):
    return hexlify(hashlib.sha256(text.encode()).digest()).decode()
