"""The map from an electrode's signal to a distance: found again, and honest about what it is worth."""

import numpy as np
import pytest

from pretouch.calibration.field_map import learn_map
from pretouch.cli import main
from pretouch.errors import CalibrationError
from pretouch.sensing.sensor import Capacitive
from pretouch.sensing.skin import load_skin
from pretouch.sim.approach import simulated_approach

DISTANCE = np.linspace(0.3, 0.002, 300)
KNOWN = Capacitive(gain=2e-3, offset_m=0.02, power=2.0)


def approach(noise=1e-4, factor=1.0, seed=0):
    rng = np.random.default_rng(seed)
    felt = np.where(DISTANCE < 0.2, KNOWN.signal(factor * DISTANCE), 0.0)
    return felt + noise * rng.standard_normal(len(DISTANCE))


def test_a_power_law_is_found_again():
    found = learn_map(DISTANCE, approach(), ["hand"] * len(DISTANCE))
    assert found.offset_m == pytest.approx(KNOWN.offset_m, rel=0.05)
    assert found.power == pytest.approx(KNOWN.power, rel=0.03)
    assert found.noise == pytest.approx(1e-4, rel=0.4)
    told = np.array(
        [
            Capacitive(gain=found.gain, offset_m=found.offset_m, power=found.power).distance(s)
            for s in KNOWN.signal(DISTANCE)
        ]
    )
    near = DISTANCE < 0.15
    np.testing.assert_allclose(told[near], DISTANCE[near], rtol=0.05)
    assert found.spread_1 < 0.1
    assert found.farthest_m == pytest.approx(0.2, abs=0.02)


def test_things_that_give_less_or_more_spread_the_map():
    signal = np.concatenate([approach(factor=1.0), approach(factor=1.5, seed=1)])
    things = ["near"] * len(DISTANCE) + ["far"] * len(DISTANCE)
    found = learn_map(np.tile(DISTANCE, 2), signal, things)
    # the map lies between: what gives less is taken to be farther than it is
    assert found.of["far"] > 0.1 > -0.1 > found.of["near"]
    assert 0.1 < found.spread_1 < 0.4


def test_the_map_of_the_simulation_is_that_of_the_type():
    found = learn_map(*simulated_approach(Capacitive(), 0))
    usual = Capacitive()
    assert found.gain == pytest.approx(usual.gain, rel=0.02)
    assert found.offset_m == pytest.approx(usual.offset_m, rel=0.02)
    assert found.power == pytest.approx(usual.power, rel=0.02)
    assert found.spread_1 == pytest.approx(usual.spread_1, rel=0.02)


@pytest.mark.parametrize(
    ("distance", "signal", "said"),
    [
        (DISTANCE, np.random.default_rng(0).standard_normal(300), "Only"),
        (DISTANCE, 0.05 + 0.2 * DISTANCE + 0.001 * np.random.default_rng(0).standard_normal(300), "does not fall"),
        (DISTANCE, np.full(300, np.nan), "is no number"),
        (-DISTANCE, approach(), "negative"),
    ],
)
def test_what_no_map_can_be_learnt_of(distance, signal, said):
    with pytest.raises(CalibrationError, match=said):
        learn_map(distance, signal, ["x"] * 300)


def test_the_command_prints_a_type_that_a_skin_file_takes(capsys, tmp_path, panda_model):
    table = tmp_path / "approach.csv"
    rows = [f"{d},{s}" for d, s in zip(DISTANCE, approach(), strict=True)]
    table.write_text("\n".join(["distance_m,signal", *rows]))
    assert main(["skin", "map", str(table), "--name", "printed"]) == 0
    said = capsys.readouterr()
    assert "is felt from" in said.out
    unit = (
        '\n[[unit]]\nid = "e"\nlink = "link4"\nposition_m = [0.0, 0.0, 0.2]\nquaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\n'
    )
    skin = tmp_path / "skin.toml"
    skin.write_text(said.out + unit.replace("link4", panda_model.links[4]) + 'sensor = "printed"\n')
    read = load_skin(skin, panda_model).units[0].sensor
    assert isinstance(read, Capacitive)
    assert read.offset_m == pytest.approx(KNOWN.offset_m, rel=0.05)


@pytest.mark.parametrize(
    ("text", "said"),
    [("d,signal\n1,2", "no column 'distance_m'"), ("distance_m,signal\n0.1,x", "signal is 'x' in line 2")],
)
def test_what_is_wrong_with_a_table_is_named(capsys, tmp_path, text, said):
    table = tmp_path / "approach.csv"
    table.write_text(text)
    assert main(["skin", "map", str(table)]) != 0
    assert said in capsys.readouterr().err.replace("\n", " ")
