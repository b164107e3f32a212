"""A unit told over a serial line who it is: against the firmware's own provisioning, through a pseudo-terminal."""

import importlib
import json
import os
import stat
import struct
import sys
import termios
import threading
import tty
import types
from dataclasses import replace
from pathlib import Path

import pytest

from pretouch import cli
from pretouch.errors import HardwareError
from pretouch.hardware.keys import UnitKey, load_keys, new_key
from pretouch.hardware.provision import Network, fingerprint, greet, provision
from pretouch.hardware.serial_line import SerialLine

FIRMWARE = Path(__file__).parents[2] / "firmware"
BOOT = b"\x00\xffets Jan  8 2013,rst cause:2, boot mode:(3,6)\r\n\x9c{garbage\n"
NETWORK = Network("lab", "correct horse", "192.168.1.10", 29470)


def firmware_provisioning(folder):
    """The firmware's own module, which keeps what it is told in a folder."""
    known = dict(sys.modules)
    sys.modules["micropython"] = types.SimpleNamespace(const=lambda value: value)
    sys.path.insert(0, str(FIRMWARE))
    try:
        theirs = importlib.import_module("provisioning")
        theirs.Config.save.__defaults__ = (str(folder / "config.json"),)
    finally:
        sys.path.remove(str(FIRMWARE))
        for name in set(sys.modules) - set(known):
            del sys.modules[name]
    return theirs.Provisioning(None, {"firmware": "0.1", "board": "a test"})


class Unit:
    """The far end of a pseudo-terminal."""

    def __init__(self, answer, boot=BOOT):
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        self._slave, self._answer = slave, answer
        self.heard = []
        os.write(self._master, boot)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        rest = b""
        while True:
            try:
                data = os.read(self._master, 4096)
            except OSError:
                return
            *lines, rest = (rest + data).split(b"\n")
            for line in filter(None, lines):
                if line == b"end":
                    return
                self.heard.append(line)
                answer = self._answer(line.decode())
                if answer is not None:
                    os.write(
                        self._master, (answer if isinstance(answer, bytes) else json.dumps(answer).encode()) + b"\r\n"
                    )

    def close(self):
        os.write(self._slave, b"end\n")
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)


@pytest.fixture
def unit(tmp_path):
    ends = Unit(firmware_provisioning(tmp_path).answer)
    yield ends
    ends.close()


@pytest.fixture
def unit_like():
    made = []

    def make(answer, boot=BOOT):
        made.append(Unit(answer, boot))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def password(tmp_path):
    place = tmp_path / "password"
    place.write_text("correct horse\n")
    return place


def arguments(unit, tmp_path, password, *more):
    return [
        "skin", "provision", "--id", "hand-1", "--keys", str(tmp_path / "keys.toml"), "--device", unit.device,
        "--ssid", "lab", "--host", "192.168.1.10", "--password-file", str(password), *more,
    ]  # fmt: skip


def test_a_new_unit_is_told_its_key_and_says_so(unit, tmp_path, password, capsys):
    assert cli.main(arguments(unit, tmp_path, password)) == 0
    key = load_keys(tmp_path / "keys.toml")["hand-1"]
    assert key.number == 1
    assert stat.S_IMODE((tmp_path / "keys.toml").stat().st_mode) == 0o600
    stored = json.loads((tmp_path / "config.json").read_text().splitlines()[0])
    assert stored["key"] == key.key.hex()
    assert (stored["unit"], stored["ssid"], stored["password"]) == (1, "lab", "correct horse")
    assert (stored["host"], stored["port"]) == ("192.168.1.10", 29470)
    said = "".join(capsys.readouterr())
    assert "hand-1 is number 1 with the key " + fingerprint(key.key) in said
    assert key.key.hex() not in said
    assert "correct horse" not in said


def test_a_unit_is_told_its_range_finder_where_that_has_zones(unit, tmp_path, password):
    assert cli.main(arguments(unit, tmp_path, password, "--sensor", "vl53l5cx", "--zones", "8")) == 0
    stored = json.loads((tmp_path / "config.json").read_text().splitlines()[0])
    assert (stored["sensor"], stored["zones"]) == ("vl53l5cx", 8)
    for wrong in ({"sensor": "vl53l8cx"}, {"sensor": "vl53l5cx", "zones": 5}):
        with pytest.raises(HardwareError, match="choose from vl53l1x, vl53l5cx, vl53l7cx, and 4 or 8"):
            replace(NETWORK, **wrong)


def test_the_same_unit_is_told_again_without_ado_and_another_one_only_if_asked(unit, tmp_path, password, capsys):
    assert cli.main(arguments(unit, tmp_path, password)) == 0
    assert cli.main(arguments(unit, tmp_path, password, "--ssid", "attic")) == 0
    other = ["--id", "hand-2"]
    assert cli.main(arguments(unit, tmp_path, password, *other)) == 2
    said = capsys.readouterr().err
    assert "was set up before: it is number 1, not 2; --replace changes it" in said
    assert "hand-2" not in load_keys(tmp_path / "keys.toml")
    assert cli.main(arguments(unit, tmp_path, password, *other, "--replace")) == 0
    assert load_keys(tmp_path / "keys.toml")["hand-2"].number == 2
    (tmp_path / "keys.toml").unlink()
    assert cli.main(arguments(unit, tmp_path, password, "--number", "2")) == 2
    assert "with another key" in capsys.readouterr().err


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
        (("--port", "0"), "The port is 0"),
        (("--ssid", "x" * 33), "give 1 to 32 bytes"),
        (("--number", "70000"), "The number of unit hand-1 is 70000"),
        (("--device", "/dev/none-such"), "There is no device /dev/none-such: plug the unit in"),
        (("--device", "/dev/null"), "/dev/null is not a serial line"),
        (("--password-file", "/nowhere"), "The password file /nowhere cannot be read"),
        (("--keys", "/nowhere/keys.toml"), "The keys cannot be written to /nowhere/keys.toml"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(unit, tmp_path, password, capsys, more, words):
    assert cli.main(arguments(unit, tmp_path, password, *more)) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_a_password_that_is_none_is_said_without_showing_it(unit, tmp_path, password, capsys):
    password.write_text("short\n")
    assert cli.main(arguments(unit, tmp_path, password)) == 2
    said = capsys.readouterr().err
    assert "The password has 5 bytes: give 8 to 63 for WPA" in said
    assert "short" not in said


def test_a_mute_line_and_one_with_something_else_are_told_apart(unit_like):
    mute, chatty = unit_like(lambda line: None, b""), unit_like(lambda line: b">>> NameError: name 'null'")
    with SerialLine(mute.device) as line, pytest.raises(HardwareError, match=r"Nothing answers within 0\.3 s: press"):
        greet(line, 0.3)
    with SerialLine(chatty.device) as line, pytest.raises(HardwareError, match=r"not a Pretouch unit .*NameError"):
        greet(line, 0.3)


def test_a_line_that_the_boot_messages_spoilt_is_asked_again(unit_like):
    answers = iter([{"ok": False, "error": "the line is not JSON"}])
    peer = {"ok": True, "unit": 3, "fingerprint": "0badcafe", "firmware": "0.1", "board": "esp8266"}
    unit = unit_like(lambda line: next(answers, peer))
    with SerialLine(unit.device) as line:
        found = greet(line, 5.0)
    assert (found.unit, found.fingerprint, found.firmware, found.board) == (3, "0badcafe", "0.1", "esp8266")


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({"ok": False, "error": "the configuration could not be stored"}, "The unit refuses: the configuration could"),
        ({"ok": True, "unit": 9, "fingerprint": "00000000"}, "says it is number 9 with the key 00000000"),
        ({"ok": True, "unit": "\x1b[2J", "fingerprint": 7}, "says it is number None"),
        (None, r"does not answer within 0\.3 s"),
    ],
)
def test_what_a_unit_says_it_is_is_checked(unit_like, answer, words):
    key = UnitKey("hand-1", 4, new_key())
    unit = unit_like(lambda line: answer)
    with SerialLine(unit.device) as line, pytest.raises(HardwareError, match=words) as caught:
        provision(line, key, NETWORK, 0.3)
    assert key.key.hex() not in str(caught.value)


def test_a_unit_that_repeats_secrets_does_not_get_them_shown(unit_like):
    key = UnitKey("hand-1", 4, new_key())
    unit = unit_like(lambda line: {"ok": False, "error": f"what is {line}?"})
    with SerialLine(unit.device) as line, pytest.raises(HardwareError) as caught:
        provision(line, key, NETWORK, 1.0)
    assert key.key.hex()[:16] not in str(caught.value)
    assert "correct horse" not in str(caught.value)
    assert "correct horse" not in repr(NETWORK)


def test_a_line_is_held_by_one_program_at_a_time(unit_like, monkeypatch):
    unit = unit_like(lambda line: None)
    with SerialLine(unit.device):
        if os.geteuid():  # the system lets root in
            with pytest.raises(HardwareError, match="is in use by another program"):
                SerialLine(unit.device)
    monkeypatch.setattr(os, "open", _denied)
    with pytest.raises(HardwareError, match="usermod -aG dialout"):
        SerialLine(unit.device)


def _denied(*_, **__):
    raise PermissionError(13, "Permission denied")


def test_a_unit_is_reset_without_asking_for_its_boot_loader(unit_like, monkeypatch):
    asserted, held = {termios.TIOCM_DTR, termios.TIOCM_RTS}, []  # as the system leaves them when a line is opened

    def ioctl(handle, request, argument):
        lines = {line for line in (termios.TIOCM_DTR, termios.TIOCM_RTS) if struct.unpack("i", argument)[0] & line}
        asserted.difference_update(lines) if request == termios.TIOCMBIC else asserted.update(lines)
        held.append(set(asserted))

    with SerialLine(unit_like(lambda line: None).device) as line:
        line.reset()  # a pseudo-terminal has no control lines
        monkeypatch.setattr("fcntl.ioctl", ioctl)
        line.reset()
        monkeypatch.undo()
    assert {termios.TIOCM_DTR} not in held
    assert {termios.TIOCM_RTS} in held
    assert held[-1] == set()


def test_a_line_that_goes_away_is_said():
    master, slave = os.openpty()
    line = SerialLine(os.ttyname(slave))
    os.close(slave)
    os.close(master)
    with pytest.raises(HardwareError, match="disappeared"):
        line.read(1.0)
    line.close()


def test_a_unit_that_goes_away_when_it_is_reset_is_said_with_the_way_out():
    master, slave = os.openpty()
    with SerialLine(os.ttyname(slave)) as line:
        os.close(slave)
        os.close(master)
        line.reset()
        with pytest.raises(HardwareError, match=r"disappeared.*within 3 s after a reset"):
            greet(line, 1.0)


def test_the_password_is_asked_for_without_echo(unit, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("getpass.getpass", lambda prompt: asked.append(prompt) or "correct horse")
    given = arguments(unit, tmp_path, "")
    assert cli.main(given[: given.index("--password-file")]) == 0
    assert asked == ["Password of lab (empty for an open network): "]
