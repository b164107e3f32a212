import json

import pytest

from pretouch_lab.engine import run_tasks
from pretouch_lab.experiments import static
from pretouch_lab.sweep.design import sweep_of
from pretouch_lab.sweep.play import opened, play_cells
from pretouch_lab.sweep.setting import built
from pretouch_lab.sweep.streams import measure


def test_a_cell_of_the_static_experiment_is_its_trial(context):
    what = measure("static")
    found = what.run(built(what.profile, what.scene, {}, 1000), None)
    where = {"trajectory": "circle", "side": "-y", "stiffness_n_per_m": 25_000.0, "restrictions": "off"}
    row, _ = static.trial(where | {"profile": "paper"}, 1000, context)
    assert found["true_peak_n"] == row["true_peak_n"] > 5.0
    assert found["delay_s"] == row["detection_delay_s"] > 0.0
    assert set(found) == set(what.metrics)


def played(sweep, out):
    """Each recorded stream's numbers, one for each detector."""
    run = opened(sweep, out)
    run_tasks(run.tasks, out, lambda _: None, processes=1)
    assert run.failures() == []
    return [task.row()["metrics"] for task in run.tasks]


def test_detectors_of_one_stream_are_one_job_and_other_sensing_is_another(tmp_path):
    sweep = sweep_of(
        "free-motion", {"detect.f_base_n": "4.5,20", "sensing.rate_hz": "10,50"},
        {"scene.counted_s": "3", "scene.warm_up_s": "2"}, design="grid", arms=1,
    )  # fmt: skip
    (low, high), (_, _) = played(sweep, tmp_path)
    # nothing but F_b differs, and the margin is F_b less what does not depend on it
    assert high["least_margin_n"] - low["least_margin_n"] == pytest.approx(15.5)
    assert high["alarms"] == 0.0
    assert (low["least_margin_n"] < 0) == (low["alarms"] > 0)
    assert low["false_alarms_per_hour"] == pytest.approx(low["alarms"] * 3600 / 3.0, rel=0.01)


def test_contacts_are_felt_sooner_with_a_lower_threshold(tmp_path):
    fixed = {"scene.contacts": "4", "scene.warm_up_s": "2"}
    ((low, high),) = played(sweep_of("contacts", {"detect.f_base_n": "6,30"}, fixed, design="grid", arms=1), tmp_path)
    assert low["missed"] <= high["missed"]
    assert low["delay_s"] > 0.0


def test_a_stream_that_cannot_be_recorded_fails_all_of_its_cells_with_the_reason(tmp_path):
    cells = [({"skin.units": 999, "detect.f_base_n": force}, 0) for force in (8.0, 9.0)]
    play_cells("free-motion", "paper", cells, tmp_path / "cells.json")
    row = json.loads((tmp_path / "cells.json").read_text())
    assert "whole number to 64" in row["failed"]
    assert row["metrics"] == []
