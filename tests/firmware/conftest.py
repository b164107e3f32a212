"""The interpreters of a sensor unit's code (harness.py)."""

from functools import partial
from pathlib import Path

import pytest

from tests.firmware import harness


@pytest.fixture(params=["cpython", "micropython"])
def unit_python(request: pytest.FixtureRequest, tmp_path: Path) -> harness.Run:
    """Both interpreters, one after the other."""
    return harness.micropython if request.param == "micropython" else partial(harness.cpython, folder=tmp_path)
