"""Tests of the product's Franka arm against the served one, through the vendor's libraries."""

from contextlib import ExitStack, closing

import pytest
from fci.tests.driver.served import Served
from tests.needs import modules_with

from pretouch.extras import FRANKA

pytest_pycollect_makemodule = modules_with(FRANKA)


@pytest.fixture
def serve(tmp_path):
    """Starts simulated arms: of a kind, with more options of `pretouch serve-fci`."""
    with ExitStack() as opened:
        yield lambda kind, *more: opened.enter_context(closing(Served(tmp_path, kind, *more)))
