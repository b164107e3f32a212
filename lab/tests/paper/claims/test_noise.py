import json

import numpy as np
import pytest
from lab.tests.width import width

from pretouch.sim.plant_params import PlantParams
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.experiment import Sources
from pretouch_lab.paper.claims import free_motion, free_run, noise

SECONDS = 6.0
ROW = {
    "experiment", "noise_factor", "profile", "seed", "hours", "offset_n", "std_n", "largest_deviation_n",
    "norm_median_n", "norm_p95_n", "norm_p99_n", "norm_max_n", "f_sigma_n", "band_n", "f_sigma_capped", "detections",
}  # fmt: skip


def cell(factor):
    return Cell(noise.NAME, free_run.PROFILE, {"noise_factor": factor})


@pytest.fixture(scope="module")
def rows(context):
    return [noise.trial(cell(factor), 100, context, SECONDS)[0] for factor in (1.0, 6.0)]


def test_a_row_says_all_there_is_to_say(rows):
    for row in rows:
        assert set(row) == ROW
        assert json.loads(json.dumps(row, allow_nan=False)) == row
        assert row["hours"] == pytest.approx(SECONDS / 3600)


def test_noise_spreads_the_estimate_and_widens_the_band(rows):
    usual, noisy = rows
    assert all(b > 1.5 * a for a, b in zip(usual["std_n"], noisy["std_n"], strict=True))
    assert all(b > a for a, b in zip(usual["f_sigma_n"], noisy["f_sigma_n"], strict=True))


def test_without_more_noise_it_is_the_arm_of_free_motion(context, rows):
    where = {"trajectory": "circle", "speed_m_s": 0.3}
    free, _ = free_motion.trial(Cell(free_motion.NAME, free_run.PROFILE, where), 100, context, SECONDS)
    shared = ROW - {"experiment", "noise_factor", "detections"}
    assert {key: free[key] for key in shared} == {key: rows[0][key] for key in shared}


def test_the_factor_is_on_the_sensors_noise_alone():
    usual, noisy = PlantParams(), noise.noisy(3.0)
    assert noisy.torque_noise_nm == pytest.approx([3 * value for value in usual.torque_noise_nm])
    assert noisy.ripple_nm == pytest.approx([3 * value for value in usual.ripple_nm])
    assert noisy.velocity_noise_rad_s == pytest.approx(0.024)
    assert noisy.torque_offset_nm == usual.torque_offset_nm
    assert noisy.friction_f1_nm == usual.friction_f1_nm
    assert noise.noisy(1.0) == usual


def test_what_a_lone_spike_of_110_n_counts_as():
    force = np.zeros((400, 3))
    force[200, 2] = -110.0
    counts = {(d["detector"], d["force_n"], d["near"]): d["count"] for d in noise.detections(force)}
    # eq. 8 makes 11 N of it, 10.89 from the mean, with sigma 1.1: F_sigma alone keeps it below 11.1
    assert counts == {
        ("filtered", 10.0, False): 0,
        ("filtered", 10.0, True): 1,
        ("no F_sigma", 10.0, False): 1,
        ("no F_sigma", 10.0, True): 1,
        ("raw", 10.0, False): 1,
        ("fixed", 10.0, False): 1,
        ("fixed", 20.0, False): 1,
    }


def made_row(factor, seed, value, count):
    found = [{"detector": "fixed", "force_n": 10.0, "near": False, "count": count}]
    axes = [value, 2 * value, 3 * value]
    return {
        "experiment": "noise", "noise_factor": factor, "seed": seed, "hours": 0.5, "std_n": axes, "f_sigma_n": axes,
        "f_sigma_capped": [value / 10, 0.0, 1.0], "detections": found,
    }  # fmt: skip


def test_a_summary_computed_by_hand():
    made = noise.summary([made_row(6.0, 0, 9.0, 2), made_row(1.0, 0, 1.0, 0), made_row(1.0, 1, 3.0, 4)])
    usual, noisy = made["cells"]
    assert (usual["noise_factor"], usual["trials"], usual["hours"]) == (1.0, 2, 1.0)
    assert [v["median"] for v in usual["std_n"]] == [2.0, 4.0, 6.0]
    assert usual["f_sigma_capped"] == pytest.approx([0.2, 0.0, 1.0])
    assert (usual["false_detections"][0]["per_hour"], usual["false_detections"][0]["arms"]) == (4.0, 1)
    assert noisy["false_detections"][0]["per_hour"] == 4.0


def test_a_run_that_was_stopped_has_a_summary_tables_and_a_figure(rows):
    for some in (rows, rows[1:], [made_row(2.0, 0, 1.0, 0)]):
        made = noise.EXPERIMENT.summarise(some)
        json.dumps(made, allow_nan=False)
        tables = noise.EXPERIMENT.tables(made)
        assert [len(table.rows) for table in tables] == [len(some)] * 2
        assert max(map(width, tables)) <= 80
        (picture,) = noise.EXPERIMENT.draw(Sources(made, lambda _: None, ()))
        picture.figure.canvas.draw()


def test_cells_are_the_noise_factors_whatever_the_profiles():
    assert [c.where["noise_factor"] for c in noise.cells(Grid(("blind", "paper")))] == [1.0, 2.0, 3.0, 4.0, 6.0]
