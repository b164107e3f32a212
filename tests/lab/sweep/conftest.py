import pytest

from tests.lab.sweep.made import register


@pytest.fixture(autouse=True)
def _ishigami(monkeypatch):
    register(monkeypatch)
