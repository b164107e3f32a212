from itertools import product

import numpy as np
import pytest
from tests.limits import assert_within_limits

from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch_lab.experiments import static


def cell(profile, trajectory="line", side="-y", restrictions="off"):
    where = {"trajectory": trajectory, "side": side, "stiffness_n_per_m": 25e3}
    return where | {"profile": profile, "restrictions": restrictions}


@pytest.fixture(scope="module")
def pair(context):
    return {name: static.trial(cell(name), 100, context) for name in ("blind", "paper")}


def test_anticipation_softens_the_contact(pair, panda_model):
    blind, paper = (pair[name][0] for name in ("blind", "paper"))
    for measure in ("impact_speed_m_s", "raw_at_detection_n", "peak_estimate_n", "true_peak_20ms_n"):
        assert blind[measure] > 2 * paper[measure]
    assert blind["filtered_at_detection_n"] > paper["filtered_at_detection_n"]
    assert (paper["contact"], paper["false_detections"], paper["held"]) == (True, 0, False)
    for _, record in pair.values():
        assert_within_limits(record, panda_model)


def test_numbers_of_a_contact_are_those_of_its_record(pair):
    row, record = pair["blind"]
    force = np.linalg.norm(record.true_force, axis=1)
    first = record.true_time[np.flatnonzero(force > 1.0)[0]]
    detected = next(step.stamp for step in record.steps if step.contact is not None)
    assert row["detection_delay_s"] == pytest.approx(detected - first, abs=1e-4)
    assert row["touched_link"] == "panda_hand"
    assert row["impact_speed_m_s"] == pytest.approx(-record.touches[0].velocity[1], abs=1e-4)
    assert row["impact_speed_m_s"] == pytest.approx(0.3, abs=0.01)
    assert record.true_force[force.argmax(), 1] > 0.95 * force.max()  # away from the object


def test_the_board_stands_on_its_side_and_moves_with_the_seed():
    walls = [static_scene("line", "-y", 25e3, seed).boxes[0] for seed in range(5)]
    faces = [wall.center[1] + wall.half_size[1] for wall in walls]
    assert all(-0.3 <= face <= -0.2 for face in faces)
    assert len(set(faces)) == 5
    assert max(faces) - min(faces) > 0.02
    assert len({wall.center[0] for wall in walls}) == len({wall.center[2] for wall in walls}) == 5
    mirrored = static_scene("line", "+y", 25e3, 3).boxes[0]
    assert mirrored.center[1] == pytest.approx(-walls[3].center[1])


def test_paths_begin_away_from_the_object_and_run_towards_it():
    for trajectory, (side, sign) in product(static.TRAJECTORIES, (("+y", 1.0), ("-y", -1.0))):
        path = static_path(trajectory, side)
        assert path.point(0.0)[1] * sign < 0
        assert max(path.point(s)[1] * sign for s in np.linspace(0, path.length, 50)) > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("trajectory", static.TRAJECTORIES)
@pytest.mark.parametrize("side", static.SIDES)
def test_hard_restrictions_never_touch_what_the_skin_senses(context, panda_model, trajectory, side):
    for seed in (102, 103, 104):
        row, record = static.trial(cell("paper", trajectory, side, "hard"), seed, context)
        assert row["contact"] is False
        nearest = min(step.obstacles.body_distance.min(initial=np.inf) for step in record.steps)
        assert 0.1 < nearest < 0.5
        assert row["least_sensed_m"] == pytest.approx(nearest, abs=1e-4)
        assert_within_limits(record, panda_model)
