"""What a unit keeps over a reset."""

import json
import os
import sys

from config import PATH, ConfigError, load
from fake_bus import error_of

os.chdir(sys.path[0])
VALUES = {
    "unit": 7, "key": "00112233445566778899aabbccddeeff" * 2, "ssid": "net", "password": "password",
    "host": "192.168.1.10", "port": 4950, "battery_full_mv": 4500, "sensor": "vl53l1x", "zones": 1, "touch_ohm": 0,
    "touch_least_mn": 500, "touch_mn_per_us": 10,
}  # fmt: skip


def _fault(text):
    with open(PATH, "w") as file:
        file.write(text)
    return error_of(load, kind=ConfigError)


def is_read_as_it_was_written():
    with open(PATH, "w") as file:
        file.write(json.dumps(VALUES))
    config = load()
    assert (config.unit, config.ssid, config.password) == (7, "net", "password")
    assert (config.host, config.port, config.battery_full_mv) == ("192.168.1.10", 4950, 4500)
    assert (config.sensor, config.zones, config.touch_ohm) == ("vl53l1x", 1, 0)
    assert config.key == bytes([0, 17, 34, 51, 68, 85, 102, 119, 136, 153, 170, 187, 204, 221, 238, 255] * 2)


def each_missing_value_is_named():
    for name in VALUES:
        values = dict(VALUES)
        del values[name]
        assert _fault(json.dumps(values)) == "the configuration has no " + name


def a_file_cut_off_anywhere_is_torn():
    whole = json.dumps(VALUES)
    for size in range(len(whole)):
        assert _fault(whole[:size]) == "the configuration is torn", size


def what_is_no_configuration_is_said_and_tells_no_secret():
    for text in ("[]", "7", "null", '"text"'):
        assert _fault(text).startswith("the configuration is no JSON object"), text
    for key in ("secret", "secret" * 20, 5):
        assert "secret" not in _fault(json.dumps(dict(VALUES, key=key)))


def none_is_told_apart_from_a_torn_one():
    with open(PATH, "w") as file:
        file.write("")
    os.remove(PATH)
    assert error_of(load, kind=ConfigError) == "there is no configuration"
