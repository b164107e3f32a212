"""A receiver with units at a real socket, under a clock set by hand."""

import pytest

from tests.hardware.fake_unit import Bench


@pytest.fixture
def bench():
    with Bench() as made:
        yield made


@pytest.fixture
def unfiltered(monkeypatch):
    """Without the filter in the kernel, as on other systems: the receiver must throw away all garbage itself."""
    monkeypatch.setattr("pretouch.hardware.receiver.attach_filter", lambda *_: False)
    with Bench() as made:
        yield made
