import json
from pathlib import Path

import pytest

from pretouch.sensing.skin import paper_skin
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.cell import Cell, Context
from pretouch_lab.paper import static
from pretouch_lab.sweep.definition import Asked, sensitivity, smaller, sweep_of
from pretouch_lab.sweep.design import points
from pretouch_lab.sweep.registry import MEASURES, measure
from pretouch_lab.sweep.setting import built
from pretouch_lab.sweep.work import cell_of, jobs_of, work

DOCS = Path(__file__).parents[3] / "docs"


def test_a_cell_of_the_static_experiment_is_its_trial():
    what = measure("static")
    found = what.run(built(what.profile, what.scene, {}, 1000), None)
    where = {"trajectory": "circle", "side": "-y", "stiffness_n_per_m": 25_000.0, "restrictions": "off"}
    row, _ = static.trial(Cell("static", "paper", where), 1000, Context(model(), paper_skin(model())))
    assert found["true_peak_n"] == row["true_peak_n"] > 5.0
    assert found["delay_s"] == row["detection_delay_s"] > 0.0
    assert set(found) == set(what.metrics)


def test_detectors_of_one_stream_are_one_job_and_other_sensing_is_another():
    sweep = sweep_of(Asked(
        "free-motion", {"detect.f_base_n": "4.5,20", "sensing.rate_hz": "10,50"},
        fix={"scene.counted_s": "3", "scene.warm_up_s": "2"}, design="grid", arms=1,
    ))  # fmt: skip
    jobs = jobs_of(sweep, [cell_of(sweep, point) for point in points(sweep)])
    assert [len(job.cells) for job in jobs] == [2, 2]
    low, high = (row["metrics"] for row in json.loads(work(jobs[0].written())))
    # nothing but F_b differs, and the margin is F_b less what does not depend on it
    assert high["least_margin_n"] - low["least_margin_n"] == pytest.approx(15.5)
    assert high["alarms"] == 0.0
    assert (low["least_margin_n"] < 0) == (low["alarms"] > 0)
    assert low["false_alarms_per_hour"] == pytest.approx(low["alarms"] * 3600 / 3.0, rel=0.01)


def test_contacts_are_felt_sooner_with_a_lower_threshold():
    sweep = sweep_of(Asked(
        "contacts", {"detect.f_base_n": "6,30"}, fix={"scene.contacts": "4", "scene.warm_up_s": "2"}, design="grid",
        arms=1,
    ))  # fmt: skip
    (job,) = jobs_of(sweep, [cell_of(sweep, point) for point in points(sweep)])
    low, high = (row["metrics"] for row in json.loads(work(job.written())))
    assert low["missed"] <= high["missed"]
    assert low["delay_s"] > 0.0


def test_a_stream_that_cannot_be_recorded_fails_all_of_its_cells_with_the_reason():
    sweep = sweep_of(Asked("free-motion", {"detect.f_base_n": "8,9"}, design="grid", arms=1))
    (job,) = jobs_of(sweep, [cell_of(sweep, point) for point in points(sweep)])
    asked = json.loads(job.written())
    for cell in asked["cells"]:
        cell["values"]["skin.units"] = 999
    rows = json.loads(work(json.dumps(asked)))
    assert ["whole number to 64" in row["reason"] for row in rows] == [True, True]


def test_the_published_sweeps_can_be_played_and_their_document_has_a_place_for_each():
    text = (DOCS / "results" / "sensitivity.md").read_text(encoding="utf-8")
    for sweep in sensitivity("published"):
        assert f"<!-- {sweep.name}: generated, begin -->" in text
        assert points(smaller(sweep, 2))
        assert max(point.seed for point in points(smaller(sweep, 2))) <= 999


def test_every_experiment_that_can_be_swept_is_described():
    text = (DOCS / "how-to" / "sweep.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in text for name in MEASURES if name != "ishigami")  # which is these tests' own
