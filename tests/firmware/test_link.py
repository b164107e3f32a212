"""The unit's side of a session, in both interpreters."""

from tests.firmware.harness import Run
from tests.firmware.together import run_all


def test_sessions(unit_python: Run) -> None:
    run_all(unit_python, "link")
