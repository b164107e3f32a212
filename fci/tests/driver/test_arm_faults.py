"""Each fault of the arm's side is noticed, named and answered in time, and the arm goes on as it should."""

import pytest
from fci.tests.driver.arm_faults import FAULTS, play

pytestmark = [pytest.mark.slow, pytest.mark.alone]
NOTICED_S, RESTED_S = 0.5, 0.8
"""Longest times [s]: a state is late by 0.2 s until it shows, a force estimate may be missing for 0.2 s."""


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_the_arm_rests_and_goes_on(tmp_path, name):
    fault, seen = FAULTS[name], play(tmp_path, name)
    assert seen.goes_on
    if fault.said:
        assert seen.held_s < NOTICED_S
        assert seen.rested_s < RESTED_S
