"""A receiver with units at a real socket, under a clock set by hand."""

import pytest

from tests.units.fake_unit import Bench


@pytest.fixture
def bench():
    with Bench() as made:
        yield made
