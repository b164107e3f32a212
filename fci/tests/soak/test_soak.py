"""Ten minutes of `make soak`, or as many as SOAK_MINUTES says."""

import os

import pytest
from fci.tests.soak.soak import RESTS_S, Soak


@pytest.mark.slow
@pytest.mark.alone
def test_minutes_of_everything_at_once_leave_no_trouble(tmp_path):
    found = Soak(tmp_path, 60.0 * float(os.environ.get("SOAK_MINUTES", "10")), seed=1).run()
    assert not found.troubles, "\n".join(found.troubles)
    assert found.recordings >= 5
    assert found.speed < 1.0
    assert max(rest for kind in found.rest_s.values() for rest in kind) < RESTS_S
