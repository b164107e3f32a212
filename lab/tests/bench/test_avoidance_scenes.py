import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch.sim.plant_params import PlantParams
from pretouch_lab.bench.avoidance_scenes import FAMILIES, plant_of, scenarios, setting


def test_every_family_has_scenarios_under_their_own_names_and_a_variant_changes_what_it_says_alone():
    assert list(dict.fromkeys(s.family for s in scenarios().values())) == list(FAMILIES)
    assert all(name == scene.name for name, scene in scenarios().items())
    small = scenarios()["small"].params["obstacle"]
    assert (small["radius_m"], small["mass_kg"]) == (0.02, 0.6)
    assert scenarios()["dark"].params["ranging"] == {"reflectance": 0.05}
    assert scenarios()["dark"].params["obstacle"] == scenarios()["drdo"].params["obstacle"]


def test_development_and_published_seeds_are_apart():
    scene = scenarios()["drdo"]
    assert scene.seeds("published", False) == list(range(10))
    assert scene.seeds("development", False) == list(range(1000, 1010))
    assert scene.seeds("development", True) == [1000]


def test_every_scenario_can_be_set_up():
    for scene in scenarios().values():
        made = setting(scene, profile("paper"), 1000)
        hand = np.array(made.setup.scene.hand.start if made.setup.scene.hand else np.zeros(3))
        distance, _ = made.shape(hand).closest(made.setup.path.point(0.0))
        assert distance > 0.05, scene.name


def test_the_person_stands_at_the_distance_the_scenario_is_about():
    for name in ("person -y", "person +y"):
        made = setting(scenarios()[name], profile("paper"), 1000)
        path = made.setup.path
        around = np.array([path.point(s) for s in np.linspace(0, path.length, 400)])
        assert made.shape(np.zeros(3)).closest(around)[0].min() == pytest.approx(0.4, abs=1e-4)


def test_a_seed_gives_the_same_walker_to_everybody_and_another_seed_another():
    first, again, other = (setting(scenarios()["walking"], profile("paper"), s).setup.hand for s in (1000, 1000, 1001))
    assert (first.speed, first.start) == (again.speed, again.start)
    assert first.speed != other.speed
    assert 0.8 <= first.speed <= 1.6


def test_friction_of_all_joints_grows_by_one_factor():
    plant = plant_of({"friction_factor": 1.5, "friction_compensated": 0.0})
    np.testing.assert_allclose(plant.friction_f1_nm, 1.5 * np.array(PlantParams().friction_f1_nm))
    assert plant.friction_compensated == 0.0
