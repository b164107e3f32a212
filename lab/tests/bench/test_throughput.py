"""What is measured of the simulation's speed, and of identified arms, on the shortest runs."""

import pytest

from pretouch_lab.bench import identification
from pretouch_lab.bench.throughput import trial


def test_a_trial_of_a_second_has_eighty_steps_for_it_stands_at_first_and_each_takes_its_part():
    row = trial(7, True, "", 1.0)
    assert (row["units"], row["person"], row["world"], row["steps"]) == (7, "yes", "nominal", 80)
    assert row["speed"] * row["cycle_ms"] * row["steps"] == pytest.approx(1000.0)


def test_an_identified_arms_numbers_are_held_against_those_it_was_drawn_with(monkeypatch):
    monkeypatch.setattr(identification, "SECONDS", 30.0)
    rows = identification.trial(1020)
    names = [row["number"] for row in rows]
    assert names.count("offset [Nm]") == 7
    assert {"payload [kg]", "observer gain [1/s]", "torque noise [Nm]"} <= set(names)
    assert max(row["off"] for row in rows if row["number"] == "offset [Nm]") < 0.1
    assert sum(row["within"] for row in rows) > 0.6 * len(rows)
