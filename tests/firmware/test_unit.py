"""In both interpreters: tests/firmware/cases/unit.py."""

from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_unit(unit_python: Run) -> None:
    run_all(unit_python, "unit")


def test_a_unit_with_zones(unit_python: Run) -> None:
    run_all(unit_python, "unit_zones")
