import pytest

from pretouch_lab.experiment import Context


@pytest.fixture(scope="session")
def context(panda_model, paper_skin):
    return Context(panda_model, paper_skin)
