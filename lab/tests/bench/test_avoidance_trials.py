"""Trials that are played: slow."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.perception.closest import closest_points
from pretouch.profiles import profile
from pretouch.robot.postures import brought_to
from pretouch_lab.bench.avoidance import trial
from pretouch_lab.bench.avoidance_scenes import FAMILIES, PANDA, scenarios, setting
from pretouch_lab.bench.obstacle import truth_of
from pretouch_lab.trial import Record

QUICK = [next(s for s in scenarios().values() if s.family == f and s.quick) for f in FAMILIES]
PLAYED = [*((scene, "paper") for scene in QUICK), *((scenarios()["drdo"], method) for method in ("flacco", "ding"))]


def test_an_arm_that_does_not_move_in_srdo_has_the_distance_of_its_geometry():
    made = setting(scenarios()["srdo"], profile("blind"), 1000)
    setup, walker = made.setup, made.setup.hand
    q = brought_to(setup.model, setup.path.point(0.0))
    times = np.arange(0.0, 9.0, 0.05)
    hands = np.array([walker.goal(t, np.zeros(3), None).position for t in times])
    kin = setup.model.kinematics(q)
    still = SimpleNamespace(q=q)
    record = Record([still] * len(times), np.zeros(0), np.zeros((0, 3)), [], hands)
    found = truth_of(record, setup.model, map(made.shape, hands))
    aside = np.array([[0.0, 0.0, 1.0]] * len(times))
    exact = closest_points(kin, setup.model.body, np.zeros(3), np.arange(len(times)), hands, aside).body_distance - 0.05
    np.testing.assert_allclose(found.distance, exact, atol=1e-3)
    # the obstacle's way leads through the upper arm, which stands at y = 0
    assert found.distance.min() < 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "baseline"), PLAYED, ids=lambda given: getattr(given, "name", given))
def test_a_trial_of_every_family_can_be_played_and_the_published_methods_move_out_of_the_way(scene, baseline):
    row = trial("", PANDA, {"scenario": scene.name, "contender": baseline}, 1000)
    json.dumps(row, allow_nan=False)
    assert row["solver_failures"] == 0
    assert row["duration_s"] <= scene.params["duration_s"] + 0.02
    if baseline != "paper":
        assert row["off_path_max_m"] > 0.05
        assert row["infeasible"] == 0
