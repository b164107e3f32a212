"""What a unit is given once and keeps: who it is, its key, its network, its receiver (docs/how-to/flashing.md).

`pretouch skin provision` checks the file before it copies it.
"""

import json
from binascii import unhexlify

PATH = "config.json"
_FIELDS = (
    "unit", "ssid", "password", "host", "port", "battery_full_mv", "sensor", "zones", "touch_ohm", "touch_least_mn",
    "touch_mn_per_us",
)  # fmt: skip


class ConfigError(Exception):
    """A configuration is missing, torn or incomplete; the text says what and never holds a secret."""


class Config:
    """A configuration, from the dictionary that the file holds; one that lacks something is a `ConfigError`."""

    def __init__(self, values):
        try:
            for name in _FIELDS:
                setattr(self, name, values[name])
            self.key = unhexlify(values["key"])
        except KeyError as error:
            raise ConfigError("the configuration has no " + error.args[0]) from None
        except (TypeError, ValueError):
            raise ConfigError("the configuration is no JSON object with a key of hex digits") from None


def load(path=PATH):
    """Return the stored configuration; `ConfigError` if there is none or it cannot be read."""
    try:
        with open(path) as file:
            values = json.loads(file.read())
    except OSError:
        raise ConfigError("there is no configuration") from None
    except (UnicodeError, ValueError):
        raise ConfigError("the configuration is torn") from None
    return Config(values)
