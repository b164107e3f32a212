"""Over the serial line: who a unit is, and who it shall be."""

import json
import os
import sys

from clock import Clock
from config import Config, load
from fake_bus import Clock as FakeClock
from fake_receiver import FakeTime
from provisioning import Provisioning

os.chdir(sys.path[0])
KEY = "00112233445566778899aabbccddeeff" * 2
LINE = {"pretouch": 1, "unit": 7, "key": KEY, "ssid": "net", "password": "password", "host": "10.0.0.1", "port": 4950}
FACTS = {"firmware": "0.1", "board": "test", "last_error": ""}
TOLD = dict(FACTS, ok=True, unit=7, fingerprint="4773d12e")


class _Console:
    """A serial line: what is said at which time [us]; the clock runs while it is read."""

    def __init__(self, clock, *said):
        self.clock = clock
        self.said = list(said)
        self.answers = []

    def read(self, wait_ms):
        self.clock.advance(1_000 * wait_ms)
        if self.said and self.said[0][0] <= self.clock.now_us:
            at, text = self.said.pop(0)
            if text[10:]:
                self.said.insert(0, (at, text[10:]))
            return text[:10]
        return b""

    def write(self, text):
        assert text[-1] == "\n"
        assert "\n" not in text[:-1]
        self.answers.append(json.loads(text))


def _listen(config, *said):
    fake = FakeClock()
    console = _Console(fake, *said)
    provisioning = Provisioning(config, FACTS)
    provisioning.listen(console, Clock(FakeTime(fake)), 3_000_000)
    return fake.now_us, console.answers, provisioning.config


def _answer(line, config=None):
    return Provisioning(config, FACTS).answer(line if isinstance(line, bytes) else json.dumps(line).encode())


def hello_is_answered_before_and_after():
    assert _answer({"pretouch": "hello"}) == dict(FACTS, ok=True, unit=None, fingerprint=None)
    assert _answer({"pretouch": "hello"}, Config(LINE)) == TOLD


def a_configuration_is_stored_and_told():
    assert _answer(LINE) == TOLD
    assert load().unit == 7
    assert load().key == Config(LINE).key


def no_answer_holds_a_secret():
    for line in (LINE, {"pretouch": "hello"}, dict(LINE, unit=0), dict(LINE, port=0)):
        said = json.dumps(_answer(line, Config(LINE)))
        assert KEY not in said
        assert "password" not in said
        assert KEY[:16] not in said


def a_wrong_line_is_refused_and_changes_nothing():
    Config(LINE).save()
    for line, error in (
        (b"{", "the line is not JSON"),
        (b"\xff\xfe", "the line is not JSON"),
        (b"[1]", "the line must be a JSON object with the member pretouch"),
        (b"{}", "the line must be a JSON object with the member pretouch"),
        ({"pretouch": 2}, 'pretouch must be 1 or "hello"'),
        ({"pretouch": True}, 'pretouch must be 1 or "hello"'),
        ({"pretouch": None}, 'pretouch must be 1 or "hello"'),
        (dict(LINE, unit=0), "unit must be a whole number from 1 to 65535"),
        (dict(LINE, unit=8, host="h"), "host must be an IPv4 address such as 192.168.1.10"),
    ):
        assert _answer(line) == {"ok": False, "error": error}, line
    assert load().unit == 7


def a_unit_with_a_configuration_listens_for_3_s():
    ended, answers, config = _listen(Config(LINE))
    assert 3_000_000 <= ended <= 3_050_000
    assert answers == []
    assert config.unit == 7


def each_sound_line_prolongs_the_listening_and_noise_does_not():
    ended, answers, _ = _listen(Config(LINE), (2_900_000, b'{"pretouch": "hello"}\r\n'), (5_000_000, b"x\n"))
    assert 5_900_000 <= ended <= 6_100_000
    assert answers[0] == TOLD
    assert not answers[1]["ok"]
    assert len(answers) == 2


def half_a_line_does_not_hold_a_unit_up():
    ended, answers, _ = _listen(Config(LINE), (1_000_000, b'{"pretouch": "hel'))
    assert ended <= 3_050_000
    assert answers == []


def without_a_configuration_it_listens_until_it_has_one():
    line = json.dumps(LINE).encode()
    ended, answers, config = _listen(None, (700_000_000, b"{}\n"), (1_400_000_000, b"\n\r\n" + line + b"\n"))
    assert ended > 1_400_000_000
    assert config.unit == 7
    assert answers == [{"ok": False, "error": "the line must be a JSON object with the member pretouch"}, TOLD]


def a_line_too_long_is_refused_and_the_next_is_read():
    said = (0, b"x" * 1_000 + b'\n{"pretouch": "hello"}\n')
    _, answers, _ = _listen(Config(LINE), said)
    assert answers == [{"ok": False, "error": "the line is longer than 512 bytes"}, TOLD]


def the_longest_line_there_can_be_is_taken():
    longest = dict(LINE, unit=65535, port=65535, host="223.255.255.255", battery_full_mv=20000)
    longest["ssid"], longest["password"] = "\u00e9" * 16, '"' * 63
    _, answers, config = _listen(Config(LINE), (0, json.dumps(longest).encode() + b"\n"))
    assert answers[0]["unit"] == 65535
    assert config.ssid == longest["ssid"]
    assert config.password == longest["password"]


def a_full_memory_is_told():
    rename, os.rename = os.rename, _full
    try:
        assert _answer(LINE) == {"ok": False, "error": "the configuration could not be stored: error 28"}
    finally:
        os.rename = rename


def _full(*_):
    raise OSError(28)
