"""A collision as it was recorded, for all tests of reports."""

import pytest

from tests.reporting import made


@pytest.fixture(scope="session")
def touched(panda_model, paper_skin) -> made.Recorded:
    return made.played(panda_model, paper_skin, "blind", seconds=6.0)[0]
