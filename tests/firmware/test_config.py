"""In both interpreters: tests/firmware/cases/config.py."""

from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_config(unit_python: Run) -> None:
    run_all(unit_python, "config")
