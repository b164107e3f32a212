import numpy as np
import pytest
from lab.tests.sweep.made import played

from pretouch_lab.experiments import static
from pretouch_lab.sweep.design import groups, points, sweep_of, trial, values_of
from pretouch_lab.sweep.measures import measure
from pretouch_lab.sweep.parameters import built


def test_a_cell_of_the_static_experiment_is_its_trial(context):
    what = measure("static")
    found = what.run(built(what.profile, what.scene, {}, 1000), None)
    where = {"trajectory": "circle", "side": "-y", "stiffness_n_per_m": 25_000.0, "restrictions": "off"}
    row, _ = static.trial(where | {"profile": "paper"}, 1000, context)
    assert found["true_peak_n"] == row["true_peak_n"] > 5.0
    assert found["delay_s"] == row["detection_delay_s"] > 0.0
    assert set(found) == set(what.metrics)


def test_detectors_of_one_stream_are_one_play_and_other_sensing_is_another():
    vary = {"detect.f_base_n": "4.5,20", "sensing.rate_hz": "10,50"}
    fixed = {"scene.counted_s": "3", "scene.warm_up_s": "2"}
    first, second = played(sweep_of("free-motion", vary, fixed, design="grid", arms=1))[0]
    low, high = first["metrics"]
    assert len(second["metrics"]) == 2
    # nothing but F_b differs, and the margin is F_b less what does not depend on it
    assert high["least_margin_n"] - low["least_margin_n"] == pytest.approx(15.5)
    assert high["alarms"] == 0.0
    assert (low["least_margin_n"] < 0) == (low["alarms"] > 0)
    assert low["false_alarms_per_hour"] == pytest.approx(low["alarms"] * 3600 / 3.0, rel=0.01)


def test_contacts_are_felt_sooner_with_a_lower_threshold():
    fixed = {"scene.contacts": "4", "scene.warm_up_s": "2"}
    _, values = played(sweep_of("contacts", {"detect.f_base_n": "6,30"}, fixed, design="grid", arms=1))
    assert values["missed"][0] <= values["missed"][1]
    assert values["delay_s"][0] > 0.0


def test_a_stream_that_cannot_be_recorded_fails_all_of_its_cells_with_the_reason():
    cells = [{"skin.units": 999, "detect.f_base_n": force} for force in (8.0, 9.0)]
    row = trial("free-motion", "paper", {"cells": cells}, 0)
    assert "whole number to 64" in row["failed"]
    assert row["metrics"] == []
    sweep = sweep_of("free-motion", {"detect.f_base_n": "8,9"}, {}, design="grid", arms=1)
    grouped = groups(sweep, points(sweep))
    assert np.isnan(values_of(sweep, 2, zip(grouped, [row], strict=True))["alarms"]).all()
