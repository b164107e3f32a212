"""What is measured of the simulation's speed, on the shortest run."""

import pytest

from pretouch_lab.bench.throughput import trial


def test_a_trial_of_a_second_has_eighty_steps_for_it_stands_at_first_and_each_takes_its_part():
    row = trial(7, True, "", 1.0)
    assert (row["units"], row["person"], row["world"], row["steps"]) == (7, "yes", "nominal", 80)
    assert row["speed"] * row["cycle_ms"] * row["steps"] == pytest.approx(1000.0)
