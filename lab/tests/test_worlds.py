from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pretouch.errors import ParameterError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch_lab.domain_randomisation import SETS, DrawnWorld, Misplacement, drawn, with_own, world_set


def test_the_nominal_world_is_the_usual_one():
    assert drawn(world_set("nominal"), 5) == DrawnWorld(PlantParams(), RangeFinderParams(), Misplacement())


@pytest.mark.parametrize("name", SETS)
def test_one_seed_is_one_world(name):
    chosen = world_set(name)
    assert drawn(chosen, 1001) == drawn(world_set(name), 1001)
    assert name == "nominal" or drawn(chosen, 1001) != drawn(chosen, 1002)


@pytest.mark.parametrize("name", ["realistic", "stress"])
def test_every_draw_is_within_its_range_and_has_a_source(name):
    chosen = world_set(name)
    assert chosen.about
    assert all(spread.source for spread in chosen.spreads.values())
    by_name = chosen.spreads
    for seed in range(1000, 1040):
        world = drawn(chosen, seed)
        low, high = by_name["plant.observer_gain_1_s"].ends
        assert low <= world.plant.observer_gain_1_s <= high
        low, high = by_name["plant.ripple_nm"].ends
        for value, usual in zip(world.plant.ripple_nm, PlantParams().ripple_nm, strict=True):
            assert low * usual <= value <= high * usual
        assert 0.0 <= world.misplaced.position_mm <= by_name["misplaced.position_mm"].ends[1]


def test_stress_reaches_farther_than_realistic():
    wide, narrow = ({field: s.ends for field, s in world_set(name).spreads.items()} for name in ("stress", "realistic"))
    assert set(wide) == set(narrow)
    for name in narrow:
        assert wide[name][0] <= narrow[name][0] or wide[name][1] > narrow[name][1], name


def test_a_field_is_drawn_alike_whatever_else_is(tmp_path):
    one, both = tmp_path / "one.toml", tmp_path / "both.toml"
    one.write_text("[plant.mass_error]\nuniform = [0.0, 0.1]\n")
    both.write_text("[plant.damping_ratio]\nuniform = [0.8, 0.9]\n" + one.read_text())
    a, b = (drawn(world_set(str(place)), 7).plant for place in (one, both))
    assert a.mass_error == b.mass_error
    assert a.damping_ratio == 1.0 != b.damping_ratio


def test_what_an_experiment_varies_stays():
    world, usual = drawn(world_set("stress"), 1003), plant_params_of(panda())
    own = replace(usual, payload_max_kg=0.33)
    assert with_own(world.plant, own, usual) == replace(world.plant, payload_max_kg=0.33)
    ranging = with_own(world.ranging, RangeFinderParams(dropout=0.9), RangeFinderParams())
    assert ranging == replace(world.ranging, dropout=0.9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[plant.mas]\nvalue = 1.0\n", "has an unknown field plant.mas: choose from period_s"),
        ("[plants.mass_error]\nvalue = 1.0\n", "has an unknown table 'plants': use about, plant, ranging, misplaced"),
        ("[plant.mass_error]\nuniform = [0.2, 0.1]\n", "give two numbers, the lower first"),
        ("[plant.mass_error]\nlog_uniform = [0.0, 0.1]\n", "and above 0"),
        ("[plant.mass_error]\nuniform = [0.0, 0.1]\nvalue = 3\n", "give one of value, uniform"),
        ("[plant.mass_error]\nuniform = [0.0, nan]\n", "give two numbers"),
        ("[plant.mass_error]\nunform = [0.0, 0.1]\n", "unknown field `unform`"),
        ("[plant.mass_error]\nvalue = 1.5\n", "PlantParams.mass_error is 1.5: it must be at most 1"),
        ("[plant.mass_error]\nvalue = 'much'\n", "give a number"),
        ("[plant.ripple_nm]\nvalue = 0.1\n", "give a list of numbers"),
        ("[plant.offsets_nm]\nvalue = [nan]\n", "give a list of numbers"),
        ("[ranging.realistic]\nvalue = 'wide'\n", "must be true or false"),
        ("[plant.payload_kg]\nvalue = [0.5]\n", "give a number"),
        ("[plant.payload_kg]\nuniform = [0.9, 1.1]\ntimes = true\n", "no usual value that it could be a factor on"),
        ("nothing", "not valid TOML"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_the_field(tmp_path, text, said):
    place = tmp_path / "world.toml"
    place.write_text(text)
    with pytest.raises(ParameterError, match=said):
        world_set(str(place))


def test_a_name_that_is_none_says_which_there_are():
    with pytest.raises(ParameterError, match="not one of nominal, realistic, stress"):
        world_set("real")


def test_every_arm_of_the_hard_world_moves_without_coming_apart(panda_model: RobotModel):
    for seed in range(1000, 1004):
        params = drawn(world_set("hard"), seed).plant
        arm = Plant(panda_model, SceneSpec(), params, panda_model.description.q_ready, seed)
        arm.command(np.full(7, 0.2))
        states = [arm.read() for _ in range(100) if arm.advance(0.01) is None]
        assert_allclose(states[-1].q - states[0].q, 0.2, atol=0.05)
        assert max(np.abs(state.tau_ext).max() for state in states) < 40.0
