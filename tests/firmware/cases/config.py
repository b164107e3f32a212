"""What a unit keeps over a reset."""

import json
import os
import sys
from binascii import hexlify
from hashlib import sha256

from config import PATH, Config, ConfigError, load

os.chdir(sys.path[0])
KEY = "00112233445566778899aabbccddeeff" * 2
LINE = {"unit": 7, "key": KEY, "ssid": "net", "password": "password", "host": "192.168.1.10", "port": 4950}


def _refused(**change):
    line = dict(LINE)
    line.update(change)
    for name in change:
        if change[name] is None:
            del line[name]
    try:
        Config(line)
    except ConfigError as error:
        return str(error)
    raise AssertionError(f"{change} was taken")


def _fault():
    try:
        load()
    except ConfigError as error:
        return str(error)
    raise AssertionError("there was a configuration")


def is_read_back_as_it_was_stored():
    Config(dict(LINE, ssid='n\u00e9t "x"\\', battery_full_mv=4500)).save()
    config = load()
    assert (config.unit, config.ssid, config.password) == (7, 'n\u00e9t "x"\\', "password")
    assert (config.host, config.port, config.battery_full_mv) == ("192.168.1.10", 4950, 4500)
    assert config.key == bytes([0, 17, 34, 51, 68, 85, 102, 119, 136, 153, 170, 187, 204, 221, 238, 255] * 2)


def a_touch_sensor_is_kept_where_there_is_one():
    Config(dict(LINE, touch_ohm=3300, touch_least_mn=500, touch_mn_per_us=10)).save()
    config = load()
    assert (config.touch_ohm, config.touch_least_mn, config.touch_mn_per_us) == (3300, 500, 10)
    Config(LINE).save()
    with open(PATH) as file:
        assert "touch" not in file.read()
    assert load().touch_ohm == 0
    assert _refused(touch_ohm=-1) == "touch_ohm must be a whole number from 0 to 1000000"
    assert _refused(touch_ohm=3300) == "touch_least_mn must be a whole number from 1 to 100000"
    assert _refused(touch_ohm=3300, touch_least_mn=1).startswith("touch_mn_per_us must be")


def a_range_finder_with_zones_is_kept_where_there_is_one():
    Config(dict(LINE, sensor="vl53l7cx", zones=8)).save()
    assert (load().sensor, load().zones) == ("vl53l7cx", 8)
    Config(LINE).save()
    with open(PATH) as file:
        assert "zones" not in file.read()
    assert (load().sensor, load().zones) == ("vl53l1x", 1)
    assert _refused(sensor="vl53l8cx") == "sensor must be one of vl53l1x, vl53l5cx, vl53l7cx"
    assert _refused(sensor=5).startswith("sensor must be one of")
    assert _refused(sensor="vl53l5cx") == "zones must be a whole number from 4 to 8"
    assert _refused(sensor="vl53l5cx", zones=5) == "zones must be 4 or 8"


def the_fingerprint_is_of_the_key():
    assert Config(LINE).fingerprint == "4773d12e"


def each_wrong_value_is_refused_by_its_name():
    for value in (0, 65536, -1, "7", 7.0, True, None):
        assert _refused(unit=value) == "unit must be a whole number from 1 to 65535"
        assert _refused(port=value) == "port must be a whole number from 1 to 65535"
    for value in (KEY[:-1], KEY + "0", "x" * 64, " " * 64, 5, None):
        assert _refused(key=value) == "key must be 64 hex digits"
    for value in ("", "x" * 33, "\u00e9" * 17, 5, None, "a\0b"):
        assert _refused(ssid=value) == "ssid must be text of 1 to 32 bytes"
    for value in ("1234567", "x" * 64, 12345678, None):
        assert _refused(password=value).startswith("password must be")
    for value in ("", "host", "1.2.3", "1.2.3.4.5", "1.2.3.256", "1.2.3.-4", "1.2..4", "1.2.3.4444", 5, None):
        assert _refused(host=value) == "host must be an IPv4 address such as 192.168.1.10"
    for value in ("010.0.0.1", "1.2.3.04", "0.0.0.0", "0.1.2.3", "127.0.0.1", "224.0.0.1", "255.255.255.255"):  # noqa: S104
        assert _refused(host=value) == "host must be an IPv4 address such as 192.168.1.10"
    assert _refused(battery_full_mv=-1) == "battery_full_mv must be a whole number from 0 to 20000"


def half_a_character_is_refused():
    half = json.loads('"net\\ud83d"')
    assert _refused(ssid=half) == "ssid must be text of 1 to 32 bytes"
    assert _refused(password=half + "work") == "password must be text of 0 to 63 bytes"


def a_character_beyond_16_bits_is_kept_as_it_is():
    name = b"net \xf0\x9f\x98\x80"
    Config(dict(LINE, ssid=json.loads(b'"' + name + b'"'))).save()
    assert load().ssid.encode() == name


def a_file_whose_sum_is_right_and_that_is_no_configuration_is_refused():
    for text in ("[]", "x", "7", "null", '"text"', ""):
        with open(PATH, "w") as file:
            file.write(text + "\n" + hexlify(sha256(text.encode()).digest()).decode() + "\n")
        assert _fault() == "the configuration is no JSON object", text


def no_refusal_tells_a_secret():
    for name in ("key", "password"):
        for value in ("secret", "secret" * 20, ["secret"]):
            assert "secret" not in _refused(**{name: value})


def an_open_network_has_an_empty_password():
    assert Config(dict(LINE, password="")).password == ""


def a_file_cut_off_anywhere_or_with_a_bit_flipped_is_torn():
    Config(LINE).save()
    with open(PATH, "rb") as file:
        whole = file.read()
    broken = [whole[:size] for size in range(len(whole))]
    broken += [whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :] for at in range(len(whole))]
    broken += [whole + b"x", b"\xff" * len(whole), bytes(len(whole))]
    for content in broken:
        with open(PATH, "wb") as file:
            file.write(content)
        assert _fault() == "the configuration is torn", content


def power_lost_while_writing_leaves_the_old_one():
    Config(LINE).save()
    with open(PATH + ".new", "w") as file:
        file.write('{"unit": 8, "ke')
    assert load().unit == 7


def none_is_told_apart_from_a_torn_one():
    Config(LINE).save()
    os.remove(PATH)
    assert _fault() == "there is no configuration"
