import pytest
from lab.tests.sweep.made import register


@pytest.fixture(autouse=True)
def _ishigami(monkeypatch):
    register(monkeypatch)
