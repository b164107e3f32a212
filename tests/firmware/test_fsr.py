"""In both interpreters: tests/firmware/cases/fsr.py."""

from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_the_force_sensing_resistor(unit_python: Run) -> None:
    run_all(unit_python, "fsr")
