"""Telling a unit who it is: its own side in both interpreters, and against the host's side."""

import pytest

from pretouch.errors import HardwareError
from pretouch.hardware.keys import UnitKey
from pretouch.hardware.provision import Network, greet, provision
from tests.firmware import harness
from tests.firmware.harness import Run
from tests.firmware.together import run_all

ANSWER = """
import json, os, sys
os.chdir(sys.path[0])
from provisioning import Provisioning
print(json.dumps(Provisioning(None, {"firmware": "0.1", "board": "test", "last_error": ""}).answer(LINE)))
"""


class UnitLine:
    """A serial line with a unit in MicroPython at its end."""

    def __init__(self) -> None:
        self._said, self._answers = b"", b""

    def write(self, data: bytes, timeout: float) -> None:
        *lines, self._said = (self._said + data).split(b"\n")
        for line in filter(None, lines):
            answers = harness.micropython({}, f"LINE = {line!r}\n{ANSWER}")
            self._answers += "\n".join([*answers, ""]).encode()

    def read(self, timeout: float) -> bytes:
        data, self._answers = self._answers, b""
        return data


def test_lines_and_their_answers(unit_python: Run) -> None:
    run_all(unit_python, "provisioning")


def test_the_hosts_side_reaches_the_unit(micropython: Run) -> None:
    line, key = UnitLine(), UnitKey("left", 7, bytes(range(32)))
    assert greet(line, 5.0).unit is None
    told = provision(line, key, Network("n\u00e9t", 'pass"word', "10.0.0.1", 4950))
    assert (told.unit, told.firmware, told.board) == (7, "0.1", "test")


def test_a_name_with_characters_beyond_16_bits_is_kept_as_it_is(micropython: Run) -> None:
    class Keeping(UnitLine):
        """Keeps what the host says."""

        said = b""

        def write(self, data: bytes, timeout: float) -> None:
            self.said += data
            super().write(data, timeout)

    line, name, password = Keeping(), "caf\u00e9 \U0001f600", "\U0001f600" * 2
    provision(line, UnitKey("left", 7, bytes(range(32))), Network(name, password, "10.0.0.1", 4950))
    read_back = "import config\nfor text in (config.load().ssid, config.load().password): print(text.encode().hex())"
    kept = micropython({}, f"LINE = {line.said.strip()!r}\n{ANSWER}\n{read_back}")[1:]
    assert kept == [name.encode().hex(), password.encode().hex()]


def test_the_units_refusal_reaches_the_host(micropython: Run) -> None:
    class Spoiling(UnitLine):
        """Another unit number than any arrives; what is told comes in pieces."""

        def write(self, data: bytes, timeout: float) -> None:
            super().write(data.replace(b'"unit": 7', b'"unit": 0'), timeout)

    with pytest.raises(HardwareError, match="unit"):
        provision(Spoiling(), UnitKey("left", 7, bytes(range(32))), Network("net", "password", "10.0.0.1", 4950))
