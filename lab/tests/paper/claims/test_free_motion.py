import json

import numpy as np
import pytest
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.control.path import PathState, advance, follow
from pretouch.params import TaskParams
from pretouch.types import Mode
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.experiment import Sources
from pretouch_lab.paper.claims import free_motion, free_run
from pretouch_lab.paper.claims.detectors import Windowed

SECONDS = 8.0
ROW = {
    "experiment", "trajectory", "speed_m_s", "profile", "seed", "hours", "offset_n", "std_n", "largest_deviation_n",
    "norm_median_n", "norm_p95_n", "norm_p99_n", "norm_max_n", "f_sigma_n", "band_n", "f_sigma_capped", "path_rms_m",
    "detections",
}  # fmt: skip


def cell(trajectory, speed):
    return Cell(free_motion.NAME, free_run.PROFILE, {"trajectory": trajectory, "speed_m_s": speed})


def record(context, trajectory, speed, seed, seconds=SECONDS):
    what = free_run.Solitude(free_motion.path(trajectory, speed), speed or 0.1, duration_s=seconds)
    return free_run.leave_alone(what, cell(trajectory, speed), seed, context)


@pytest.fixture(scope="module")
def records(context):
    return {speed: record(context, "line", speed, 100) for speed in (0.0, 0.3)}


@pytest.fixture(scope="module")
def rows(context):
    return [free_motion.trial(cell("line", speed), 100, context, SECONDS)[0] for speed in (0.0, 0.3)]


def made_row(trajectory, speed, seed, value, count=0):
    """A row whose every force is `value` on x, twice that on y and three times on z."""
    axes = [value, 2 * value, 3 * value]
    row = {"experiment": "free-motion", "trajectory": trajectory, "speed_m_s": speed, "profile": "p", "seed": seed}
    row |= dict.fromkeys(("norm_median_n", "norm_p95_n", "norm_p99_n", "norm_max_n"), 4 * value)
    row |= dict.fromkeys(("offset_n", "std_n", "largest_deviation_n", "f_sigma_n", "band_n", "f_sigma_capped"), axes)
    found = [
        {"detector": "filtered", "force_n": 10.0, "near": False, "count": count},
        {"detector": "fixed", "force_n": 20.0, "near": False, "count": 0},
    ]
    return row | {"hours": 1.0, "path_rms_m": 0.001, "detections": found}


def test_a_row_says_all_there_is_to_say(rows):
    for row in rows:
        assert set(row) == ROW
        assert json.loads(json.dumps(row, allow_nan=False)) == row
        assert row["hours"] == pytest.approx(SECONDS / 3600)
        assert len(row["detections"]) == 4 * (5 + 4) + 7


def test_nothing_touches_the_arm_and_it_never_reacts(records, panda_model):
    for found in records.values():
        assert not found.touches
        assert not np.any(found.true_force)
        assert {step.mode for step in found.steps if step.armed} == {Mode.TRACK}
        assert all(len(step.obstacles.point) == 0 for step in found.steps)
        assert_within_limits(found, panda_model)


def test_the_arm_moves_at_its_speed_or_stands(records):
    standing, moving = records[0.0].steps, records[0.3].steps
    # within 5 mm of the point: at rest the arm settles where friction and gravity leave it
    assert max(np.linalg.norm(s.ee_position - [0.4, 0.5, 0.5]) for s in standing) < 0.005
    assert standing[-1].path_phase == 0.0
    assert np.median([np.linalg.norm(s.ee_velocity) for s in moving]) == pytest.approx(0.3, abs=0.03)
    y = [s.ee_position[1] for s in moving]
    assert min(y) == pytest.approx(-0.5, abs=0.05)
    assert y[-1] > -0.4  # and on its way back


def test_the_row_describes_the_course(records, rows):
    force = records[0.3].forces()[100:]
    row = rows[1]
    assert len(force) == round(SECONDS * 100)
    assert row["offset_n"] == pytest.approx(force.mean(axis=0), abs=1e-4)
    assert row["norm_max_n"] == pytest.approx(np.linalg.norm(force, axis=1).max(), abs=1e-3)
    errors = [np.linalg.norm(s.ee_position - s.path_position) for s in records[0.3].steps[100:]]
    assert row["path_rms_m"] == pytest.approx(np.sqrt(np.mean(np.square(errors))), abs=1e-5)


def test_motion_spreads_the_estimate(rows):
    standing, moving = rows
    assert all(m > s for m, s in zip(moving["std_n"], standing["std_n"], strict=True))


def test_each_seed_is_another_arm(context, rows):
    other, _ = free_motion.trial(cell("line", 0.0), 101, context, 1.0)
    assert max(abs(a - b) for a, b in zip(other["offset_n"], rows[0]["offset_n"], strict=True)) > 0.3


def test_samples_without_an_estimate_are_left_out(records):
    found = records[0.0]
    gone = [type(s)(**{k: getattr(s, k) for k in s.__slots__} | {"force": np.full(3, np.nan)}) for s in found.steps[:7]]
    holed = type(found)(gone + found.steps[7:], found.true_time, found.true_force, [], found.hand_position)
    assert np.array_equal(free_run.estimates(holed), found.forces()[7:])


def test_results_of_a_course_computed_by_hand():
    force = np.array([[1.0, -2.0, 0.0], [3.0, -2.0, 0.0], [1.0, -2.0, 0.0], [3.0, -2.0, 4.0]])
    sigma = np.array([[0.5, 1.0, 3.0], [0.5, 2.0, 3.5], [0.5, 3.0, 2.0], [0.5, 3.0, 9.0]])
    row = free_run.estimate_results(Windowed(force, force, force, sigma))
    assert row["hours"] == pytest.approx(0.04 / 3600)
    assert row["offset_n"] == [2.0, -2.0, 1.0]
    assert row["std_n"] == pytest.approx([np.sqrt(4 / 3), 0.0, 2.0], abs=1e-4)
    assert row["largest_deviation_n"] == [1.0, 0.0, 3.0]
    assert row["norm_median_n"] == pytest.approx((np.sqrt(5) + np.sqrt(13)) / 2, abs=1e-3)
    assert row["norm_max_n"] == pytest.approx(np.sqrt(29), abs=1e-3)
    assert row["f_sigma_n"] == [0.5, 2.5, 3.0]
    assert row["band_n"] == [10.5, 12.5, 13.0]
    assert row["f_sigma_capped"] == [0.0, 0.5, 0.75]


def test_what_a_lone_spike_of_20_n_counts_as():
    force = np.zeros((400, 3))
    force[200, 1] = 20.0
    counts = {(d["detector"], d["force_n"], d["near"]): d["count"] for d in free_motion.detections(force)}
    # alpha 0.1 makes 2 N of it, 1.98 above the mean with sigma 0.2; alpha 0.3 makes 6 N, 5.94 above it with 0.6
    assert [counts["filtered", f, False] for f in (4.0, 6.0, 8.0)] == [0, 0, 0]
    assert [counts["filtered", f, True] for f in (6.0, 8.0, 10.0)] == [0, 0, 0]
    assert [counts["alpha 0.3", f, False] for f in (4.0, 6.0, 8.0)] == [1, 0, 0]
    assert [counts["alpha 0.3", f, True] for f in (6.0, 8.0, 10.0)] == [1, 1, 0]
    assert [counts["raw", f, False] for f in free_motion.F_BASE_N] == [1] * 5
    assert not any(n for (detector, _, _), n in counts.items() if detector == "raw twice")
    assert [counts["fixed", f, False] for f in free_motion.FIXED_N] == [1, 1, 1, 1, 1, 0, 0]
    assert ("filtered", 4.0, True) not in counts


def test_a_detection_is_answered_for_two_seconds():
    felt = np.ones(450, bool)
    assert free_run.tally("fixed", felt, 6.0, False)["count"] == 3


def test_rates_are_of_all_trials_together():
    rows = [made_row("line", 0.3, 0, 1.0, count=3), made_row("line", 0.3, 1, 1.0), made_row("circle", 0.3, 0, 1.0)]
    felt, fixed = free_run.false_rates(rows)
    assert (felt["count"], felt["arms"], felt["of_arms"], felt["hours"], felt["per_hour"]) == (3, 1, 2, 3.0, 1.0)
    # the arms' counts are 3 and 0: their variance is three times their mean, so they tell as much as one event an hour
    assert (felt["low_per_hour"], felt["high_per_hour"]) == pytest.approx((0.0253, 5.5716), abs=1e-3)
    assert (fixed["count"], fixed["per_hour"], fixed["low_per_hour"]) == (0, 0.0, 0.0)
    assert free_run.rate_text(felt) == "1\n0.025-5.6"
    assert free_run.rate_text(fixed) == "0\n0-1.2"
    assert free_run.rate_text(None) == "-"


def test_a_summary_computed_by_hand():
    rows = [
        made_row("line", 0.0, 0, 1.0, count=5),
        made_row("line", 0.3, 0, 2.0, count=1),
        made_row("line", 0.0, 1, -1.0),
        made_row("circle", 0.3, 1, 4.0, count=1),
    ]
    made = free_motion.summary(rows)
    standing, moving = made["cells"]
    assert (standing["speed_m_s"], standing["trials"], moving["trials"]) == (0.0, 2, 2)
    assert standing["offset_n"] == [1.0, 2.0, 3.0]
    assert [v["median"] for v in moving["std_n"]] == [3.0, 6.0, 9.0]
    assert moving["largest_deviation_n"] == [4.0, 8.0, 12.0]
    assert moving["norm_max_n"] == 16.0
    # only the line of seed 0 was run at both speeds
    assert [(v["median"], v["n"]) for v in standing["narrower_n"]] == [(1.0, 1), (2.0, 1), (3.0, 1)]
    assert [v["median"] for v in moving["narrower_n"]] == [0.0, 0.0, 0.0]
    felt = made["false_detections"][0]
    assert (felt["count"], felt["hours"]) == (2, 2.0)  # the standing arm's are not among them
    circle, line = made["by_trajectory"]
    assert [(c["speed_m_s"], c["trials"]) for c in circle["cells"]] == [(0.3, 1)]
    assert [(c["speed_m_s"], c["trials"]) for c in line["cells"]] == [(0.0, 2), (0.3, 1)]
    assert [part["false_detections"][0]["hours"] for part in (circle, line)] == [1.0, 1.0]


def test_a_run_that_was_stopped_has_a_summary_tables_and_a_figure(rows):
    for some in (rows, rows[:1], rows[1:], [made_row("circle", 0.0, 0, 1.0), made_row("line", 0.3, 0, 1.0)]):
        made = free_motion.EXPERIMENT.summarise(some)
        json.dumps(made, allow_nan=False)
        tables = free_motion.EXPERIMENT.tables(made)
        assert len(tables) == (5 if any(row["speed_m_s"] > 0 for row in some) else 2)
        assert max(map(width, tables)) <= 80
        (picture,) = free_motion.EXPERIMENT.draw(Sources(made, lambda _: None, ()))
        picture.figure.canvas.draw()


def test_cells_are_both_paths_at_each_speed_whatever_the_profiles():
    cells = free_motion.cells(Grid(("blind", "paper")))
    assert [(c.where["trajectory"], c.where["speed_m_s"]) for c in cells] == [
        (trajectory, speed) for speed in (0.0, 0.1, 0.2, 0.3) for trajectory in ("circle", "line")
    ]
    # 20 minutes for each arm
    assert sum(map(free_motion.EXPERIMENT.cost, cells)) == 1200.0


def test_a_standing_path_goes_nowhere():
    for trajectory in free_motion.TRAJECTORIES:
        standing = free_motion.path(trajectory, 0.0)
        start = free_motion.path(trajectory, 0.1).point(0.0)
        assert np.array_equal(standing.point(3.0), start)
        way = follow(standing, PathState(0.0, 0.3), start + 0.01, TaskParams())
        state = advance(standing, PathState(0.0, 0.3), way, np.zeros(3), TaskParams())
        assert state.phase == 0.0
