"""Scenarios of the avoidance benchmark, and trials of them."""

import json

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch.sim.plant_params import PlantParams
from pretouch_lab.bench.avoidance import trial
from pretouch_lab.bench.avoidance_scenes import FAMILIES, PANDA, plant_of, scenarios, setting

QUICK = [next(s for s in scenarios().values() if s.family == f and s.params["quick"]) for f in FAMILIES]
PLAYED = [*((scene, "paper") for scene in QUICK), *((scenarios()["drdo"], method) for method in ("flacco", "ding"))]


def test_every_family_has_scenarios_whose_variants_change_what_they_say_alone_and_seeds_of_their_own():
    assert list(dict.fromkeys(s.family for s in scenarios().values())) == list(FAMILIES)
    assert len(scenarios()) == 20
    small = scenarios()["small"].params["obstacle"]
    assert (small["radius_m"], small["mass_kg"]) == (0.02, 0.6)
    assert scenarios()["dark"].params["ranging"] == {"reflectance": 0.05}
    assert scenarios()["dark"].params["obstacle"] == scenarios()["drdo"].params["obstacle"]

    scene = scenarios()["drdo"]
    assert scene.seeds("published", False) == list(range(10))
    assert scene.seeds("development", False) == list(range(1000, 1010))
    assert scene.seeds("development", True) == [1000]


def test_every_scenario_can_be_set_up_and_a_person_stands_at_the_distance_it_is_about():
    for scene in scenarios().values():
        ready = setting(scene, profile("paper"), 1000)
        path, hand = ready.setup.path, np.array(ready.setup.scene.hand.start if ready.setup.scene.hand else np.zeros(3))
        assert ready.shape(hand).closest(path.point(0.0))[0] > 0.05, scene.name
        if scene.name in ("person -y", "person +y"):
            around = np.array([path.point(s) for s in np.linspace(0, path.length, 400)])
            assert ready.shape(hand).closest(around)[0].min() == pytest.approx(0.4, abs=1e-4)


def test_a_seed_gives_the_same_walker_to_everybody_and_another_seed_another():
    first, again, other = (setting(scenarios()["walking"], profile("paper"), s).setup.hand for s in (1000, 1000, 1001))
    assert first.times.tolist() == again.times.tolist() != other.times.tolist()
    start, end = first.times
    assert 0.8 <= np.linalg.norm(first.places[1] - first.places[0]) / (end - start) <= 1.6
    middle = first.goal((start + end) / 2, np.zeros(3), None)
    np.testing.assert_allclose(middle.position, first.places.mean(axis=0))
    assert middle.force_max == 400.0


def test_friction_of_all_joints_grows_by_one_factor():
    plant = plant_of({"friction_factor": 1.5, "friction_compensated": 0.0})
    np.testing.assert_allclose(plant.friction_f1_nm, 1.5 * np.array(PlantParams().friction_f1_nm))
    assert plant.friction_compensated == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "baseline"), PLAYED, ids=lambda given: getattr(given, "name", given))
def test_a_trial_of_every_family_can_be_played_and_the_published_methods_move_out_of_the_way(scene, baseline):
    row = trial("", PANDA, {"scenario": scene.name, "contender": baseline}, 1000)
    json.dumps(row, allow_nan=False)
    assert not {"solver_failed", "blocked"} & set(row["hold_events"])
    assert row["duration_s"] <= scene.params["duration_s"] + 0.02
    if baseline != "paper":
        assert row["tracking_rms_m"] > 0.05
