"""In MicroPython: tests/firmware/cases/service.py, on the fake chip of tests/firmware/board_fakes."""

from tests.firmware.harness import HERE, Run
from tests.firmware.together import run_all


def test_service(micropython: Run) -> None:
    run_all(micropython, "service", {path.name: path for path in (HERE / "board_fakes").glob("*.py")})
