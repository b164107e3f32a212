"""What a unit keeps over a reset."""

import json
import os
import sys
from binascii import hexlify

from config import PATH, ConfigError, load
from fake_bus import error_of
from fake_unit import CONFIG

os.chdir(sys.path[0])


def _written(text):
    with open(PATH, "w") as file:
        file.write(text)


def _fault(text):
    _written(text)
    return error_of(load, kind=ConfigError)


def is_read_as_it_was_written():
    _written(json.dumps(CONFIG))
    config = load()
    assert hexlify(config.key).decode() == CONFIG["key"]
    for name in CONFIG:
        assert name == "key" or getattr(config, name) == CONFIG[name], name


def each_missing_value_is_named():
    for name in CONFIG:
        values = dict(CONFIG)
        del values[name]
        assert _fault(json.dumps(values)) == "the configuration has no " + name


def a_file_cut_off_anywhere_is_torn():
    whole = json.dumps(CONFIG)
    for size in range(len(whole)):
        assert _fault(whole[:size]) == "the configuration is torn", size


def what_is_no_configuration_is_said_and_tells_no_secret():
    for text in ("[]", "7", "null", '"text"'):
        assert _fault(text).startswith("the configuration is no JSON object"), text
    for key in ("secret", "secret" * 20, 5):
        assert "secret" not in _fault(json.dumps(dict(CONFIG, key=key)))


def none_is_told_apart_from_a_torn_one():
    _written("")
    os.remove(PATH)
    assert error_of(load, kind=ConfigError) == "there is no configuration"
