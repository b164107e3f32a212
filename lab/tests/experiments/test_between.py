import json

import numpy as np
import pytest
from tests.limits import assert_within_limits

from pretouch_lab.experiments import between
from pretouch_lab.experiments.figures import close_up
from pretouch_lab.trial import trace_of

MODES = {"blind": "off", "paper": "slack"}


@pytest.fixture(scope="module")
def trials(context):
    cells = {name: {"profile": name, "restrictions": mode} for name, mode in MODES.items()}
    trials = {name: between.trial(cell, 100, context) for name, cell in cells.items()}
    return {name: (cells[name] | row, record) for name, (row, record) in trials.items()}


def test_objects_on_both_sides_narrow_the_band_from_above_and_below_and_blind_narrows_nothing(trials):
    row, record = trials["paper"]
    assert row["both_lowered"]
    assert row["both_lowered_at_touch"]
    limits = [s.thresholds for s in record.steps]
    armed = [s.thresholds for s in record.steps if s.armed]
    # F_b + F_sigma is at least 10 N: narrower is nearness
    assert min(t.upper[1] - t.mean[1] for t in armed) < 8.0
    assert min(t.mean[1] - t.lower[1] for t in armed) < 9.5
    assert max(t.upper[1] - t.mean[1] for t in armed) > 10.0
    assert any(t.obstacle_positive[1] > 0 and t.obstacle_negative[1] > 0 for t in limits)
    row, record = trials["blind"]
    assert row["contact"]
    assert not row["both_lowered"]
    assert all(np.all(s.thresholds.obstacle_positive == 0) for s in record.steps)


def test_the_push_is_felt_and_goes_away_from_the_hand_and_one_that_never_touched_has_no_results(trials, panda_model):
    row, record = trials["paper"]
    assert row["contact"]
    assert row["detected"]
    assert 0 < row["detection_delay_s"] < row["push_s"] + 0.3
    assert 6.0 < row["filtered_at_detection_n"] < row["raw_at_detection_n"]
    hardest = record.true_force[np.linalg.norm(record.true_force, axis=1).argmax()]
    assert hardest[1] > 0.8 * np.linalg.norm(hardest)

    for _, each in trials.values():
        assert_within_limits(each, panda_model)
    row = between.results(trials["blind"][1], None)
    assert row["contact"] is row["detected"] is False
    assert row["detection_delay_s"] is row["both_lowered_at_touch"] is None
    assert row["false_detections"] == len(trials["blind"][1].reactions())


def test_body_and_hand_are_on_opposite_sides_and_move_with_the_seed():
    planned = [between.interaction(seed) for seed in range(20)]
    for body, push in planned:
        assert 0.55 <= body.center[1] - body.half_size[1] <= 0.65
        assert body.center[2] - body.half_size[2] == pytest.approx(-0.2)
        assert push.inwards[1] < -0.9
        assert 15.0 <= push.force <= 30.0
        assert 5.0 <= push.start <= 7.0
    assert len({body.center for body, _ in planned}) == len({push.force for _, push in planned}) == 20


def test_the_table_counts_what_the_rows_say(trials):
    rows = [json.loads(json.dumps(row, allow_nan=False)) for row, _ in trials.values()]
    (table,) = between.tables([*rows, {**rows[1], "detected": False, "detection_delay_s": None}])
    assert [row[0] for row in table.rows] == ["blind\noff", "paper\nslack"]
    assert table.rows[0][1:3] == ("0/1", "0/1")
    assert table.rows[1][1:5] == ("2/2", "2/2", "1/2", f"{1000 * rows[1]['detection_delay_s']:.0f}")


def test_a_trace_has_the_nearest_obstacle_and_the_close_up_the_touch_and_both_bounds(trials, paper_skin):
    row, record = trials["paper"]
    trace = trace_of(record)
    for step, point in zip(record.steps[::20], trace.nearest_point[::20], strict=True):
        near = step.obstacles.point[np.argsort(step.obstacles.ee_distance)]
        np.testing.assert_array_equal(point, near[0] if len(near) else np.full(3, np.nan))
    top, bottom = close_up([({"profile": "paper"}, trace)], paper_skin.ids).axes
    low, high = bottom.get_xlim()
    touch = next(s.stamp for s in record.reactions()) - row["detection_delay_s"]
    assert low == pytest.approx(touch - 4.0, abs=0.02)
    assert high == pytest.approx(touch + 2.5, abs=0.02)
    drawn = {line.get_label(): line.get_ydata() for line in bottom.lines}
    np.testing.assert_array_equal(drawn["thresholds"], trace.upper[:, 1])
    np.testing.assert_array_equal(drawn["thresholds without F_obs"], trace.upper[:, 1] + trace.obstacle_negative[:, 1])
    assert "both bounds lowered" in [patch.get_label() for patch in top.patches]
