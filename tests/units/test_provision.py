"""A unit given its configuration over USB: what is written, and how the program that copies it is called."""

import json
import stat
from dataclasses import replace
from pathlib import Path

import pytest

from pretouch import cli
from pretouch.cli.skin_keys import Network, configuration, copy_to_unit
from pretouch.errors import HardwareError
from pretouch.units.keys import UnitKey, load_keys

NETWORK = Network("lab", "192.168.1.10")
MPREMOTE = """
import json, os, pathlib, shutil, stat, sys
folder = pathlib.Path(__file__).parent
(folder / "command.json").write_text(json.dumps(sys.argv[1:]))
source = sys.argv[4]
(folder / "mode.json").write_text(json.dumps(stat.S_IMODE(os.stat(source).st_mode)))
shutil.copy(source, folder / "config.json")
"""
"""Stands for the program: keeps what it is told, and the file that it is to copy."""


@pytest.fixture
def mpremote(tmp_path, monkeypatch):
    """Put a program in the place of mpremote; return its folder."""
    folder = tmp_path / "packages"
    folder.mkdir()

    def install(source=MPREMOTE):
        (folder / "mpremote.py").write_text(source)
        return folder

    monkeypatch.setenv("PYTHONPATH", str(folder))
    monkeypatch.syspath_prepend(str(folder))
    return install


@pytest.fixture
def password(tmp_path):
    place = tmp_path / "password"
    place.write_text("correct horse\n")
    return place


def arguments(tmp_path, password, *more):
    return [
        "skin", "provision", "--id", "hand-1", "--keys", str(tmp_path / "keys.toml"), "--device", "/dev/ttyACM7",
        "--ssid", "lab", "--host", "192.168.1.10", "--password-file", str(password), *more,
    ]  # fmt: skip


def test_a_new_unit_is_given_its_key_and_begins_anew(mpremote, tmp_path, password, capsys):
    folder = mpremote()
    assert cli.main(arguments(tmp_path, password)) == 0
    key = load_keys(tmp_path / "keys.toml")["hand-1"]
    assert key.number == 1
    assert stat.S_IMODE((tmp_path / "keys.toml").stat().st_mode) == 0o600
    copied = json.loads((folder / "config.json").read_text())
    assert copied == {
        "unit": 1, "key": key.key.hex(), "ssid": "lab", "password": "correct horse", "host": "192.168.1.10",
        "port": 29470, "battery_full_mv": 0, "sensor": "vl53l1x", "zones": 1, "touch_ohm": 0, "touch_least_mn": 500,
        "touch_mn_per_us": 10,
    }  # fmt: skip
    assert json.loads((folder / "mode.json").read_text()) == 0o600
    connect, device, cp, source, target, plus, reset = json.loads((folder / "command.json").read_text())
    assert (connect, device, cp, target, plus, reset) == ("connect", "/dev/ttyACM7", "cp", ":config.json", "+", "reset")
    assert not Path(source).exists()
    said = "".join(capsys.readouterr())
    assert "hand-1 is number 1 with the key " + key.fingerprint in said
    assert key.key.hex() not in said
    assert "correct horse" not in said


def test_a_unit_keeps_its_key_when_it_is_told_again(mpremote, tmp_path, password):
    folder = mpremote()
    assert cli.main(arguments(tmp_path, password)) == 0
    key = load_keys(tmp_path / "keys.toml")["hand-1"]
    assert cli.main(arguments(tmp_path, password, "--ssid", "attic")) == 0
    copied = json.loads((folder / "config.json").read_text())
    assert (copied["key"], copied["ssid"]) == (key.key.hex(), "attic")


def test_a_unit_is_told_its_range_finder_where_that_has_zones(mpremote, tmp_path, password):
    folder = mpremote()
    assert cli.main(arguments(tmp_path, password, "--sensor", "vl53l5cx", "--zones", "8")) == 0
    copied = json.loads((folder / "config.json").read_text())
    assert (copied["sensor"], copied["zones"]) == ("vl53l5cx", 8)
    for wrong, ways_out in (({"sensor": "vl53l8cx"}, "vl53l1x, vl53l5cx, vl53l7cx"), ({"zones": 5}, "4, 8")):
        with pytest.raises(HardwareError, match=f"choose one of {ways_out}"):
            replace(NETWORK, **wrong)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--host", "127.0.0.1"), "A unit cannot send to 127.0.0.1"),
        (("--host", "0.0.0.0"), "A unit cannot send to 0.0.0.0"),  # noqa: S104
        (("--host", "255.255.255.255"), "A unit cannot send to 255.255.255.255"),
        (("--host", "224.0.0.1"), "A unit cannot send to 224.0.0.1"),
        (("--host", "010.0.0.1"), "The host '010.0.0.1' is not an IPv4 address"),
        (("--ssid", "caf\udce9"), "The network's name is not Unicode text: give it in UTF-8."),
        (("--host", "my-pc"), "The host 'my-pc' is not an IPv4 address"),
        (("--port", "0"), "Network.port is 0: it must be at least 1"),
        (("--ssid", "x" * 33), "give 1 to 32 bytes"),
        (("--number", "70000"), "The number of unit hand-1 is 70000"),
        (("--touch-ohm", "-1"), "Network.touch_ohm is -1: it must be at least 0"),
        (("--password-file", "/nowhere"), "The password file /nowhere cannot be read"),
        (("--keys", "/nowhere/keys.toml"), "The keys cannot be written to /nowhere/keys.toml"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(mpremote, tmp_path, password, capsys, more, words):
    folder = mpremote()
    assert cli.main(arguments(tmp_path, password, *more)) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not (folder / "command.json").exists()


def test_a_password_that_is_none_is_said_without_showing_it(mpremote, tmp_path, password, capsys):
    mpremote()
    password.write_text("short\n")
    assert cli.main(arguments(tmp_path, password)) == 2
    said = capsys.readouterr().err
    assert "The password has 5 bytes: give 8 to 63 for WPA" in said
    assert "short" not in said


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise SystemExit('mpremote: failed to access /dev/ttyACM7')", "failed to access /dev/ttyACM7"),
        ("import sys; print('could not enter \\x1b[2J raw repl'); sys.exit(1)", "could not enter ?[2J raw repl"),
        ("raise SystemExit(3)", "(code 3)"),
    ],
)
def test_what_the_program_says_of_a_failure_is_said(mpremote, tmp_path, password, capsys, source, words):
    mpremote(source)
    assert cli.main(arguments(tmp_path, password)) == 2
    said = capsys.readouterr().err
    assert "mpremote could not write to the unit at /dev/ttyACM7 (" in said
    assert words in said
    assert "within 3 s after its reset button" in said


def test_a_unit_that_does_not_answer_is_given_up(mpremote):
    mpremote("import time; time.sleep(60)")
    with pytest.raises(HardwareError, match=r"at /dev/ttyACM7 did not answer within 1 s: press its reset button"):
        copy_to_unit("/dev/ttyACM7", configuration(UnitKey("hand-1", 4, bytes(32)), NETWORK, ""), 1.0)


def test_the_password_is_asked_for_without_echo(mpremote, tmp_path, monkeypatch):
    mpremote()
    asked = []
    monkeypatch.setattr("getpass.getpass", lambda prompt: asked.append(prompt) or "correct horse")
    command = arguments(tmp_path, "")
    assert cli.main(command[: command.index("--password-file")]) == 0
    assert asked == ["Password of lab (empty for an open network): "]
