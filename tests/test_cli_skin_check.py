"""`pretouch skin check-unit` on simulated units with the flaws of real ones."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.cli import main
from pretouch.cli.skin_check import delays, judged
from pretouch.errors import HardwareError
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, VL53L5CX, Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import Box, SceneSpec
from pretouch.units.fleet import FleetParams, simulated_keys
from pretouch.units.keys import save_keys
from tests.ports import free_port
from tests.sim.ranging import FORWARD, NO_ERROR, ORIGIN, wall
from tests.units.desk import Desk
from tests.wire_skin import WireSkin

FOUR, EIGHT = VL53L5CX(), VL53L5CX(zones=8)
_, Y, Z = ORIGIN


def samples(model: RobotModel, sensor: Sensor, *boxes: Box, duration: float = 2.0, speed: float = 0.0):
    """What a unit on the hand sends, which looks along +x and is moved along it, to and fro in a second."""
    skin = Skin([SensorUnit("front", "panda_hand", FORWARD, sensor=sensor)], model)
    plant = Plant(model, SceneSpec(boxes=boxes), NO_ERROR, model.description.q_ready, 0)
    along = speed * np.eye(6)[0]
    with WireSkin(plant, skin, RangeFinderParams(realistic=True), FleetParams(imu=ImuParams()), 0) as wire:
        for _ in range(round(duration / 0.01)):
            kin = model.kinematics(plant.read().q)
            J = model.jacobian(kin, model.ee, kin.position[model.ee])
            plant.command(np.linalg.pinv(J) @ along * np.sin(2 * np.pi * plant.time))
            plant.advance(0.01)
        return wire.receiver.take_samples()


@pytest.fixture(scope="module")
def parts(panda_model):
    """The four steps with a unit of 4 x 4 zones; x of its pose is up, y against that of the base."""
    rest = samples(panda_model, FOUR, wall(0.3), duration=12.0)
    moved = samples(panda_model, FOUR, wall(0.45), duration=12.0, speed=0.35)
    x, size = ORIGIN[0] + 0.1, (0.02, 0.2, 0.2)
    halves = [Box("card", (x, Y, Z - 0.205), size, 1e4), Box("card", (x, Y + 0.205, Z), size, 1e4)]
    return [rest, moved, *(samples(panda_model, FOUR, half) for half in halves)]


def test_what_a_card_and_a_motion_show_is_what_was_simulated(parts):
    numbers, wrong = judged(FOUR, 0.3, parts)
    assert not wrong
    # three quarters of what bursts leave, a constant error of zones of up to 10 mm about -11, 4 mm of noise
    assert numbers["valid"] == pytest.approx(0.68, abs=0.15)
    assert 0.0 < numbers["longest burst [s]"] < 0.9
    assert numbers["error [m]"] == pytest.approx(-0.011, abs=0.01)
    assert numbers["noise [m]"] == pytest.approx(0.0038, rel=0.2)
    assert numbers["told delay [s]"] == pytest.approx(0.0365, abs=0.001)  # 34 ms, and the unit's own 2.5
    assert numbers["hidden delay [s]"] == pytest.approx(np.full((4, 4), 0.025), abs=0.004)


def test_of_eight_by_eight_zones_a_motion_shows_the_parts_in_which_they_are_measured(panda_model):
    late = delays(samples(panda_model, EIGHT, wall(0.45), duration=12.0, speed=0.35)).reshape(8, 8)
    parts = [late[row::2, column::2].mean() for row, column in ((1, 1), (0, 0), (0, 1), (1, 0))]
    assert parts == pytest.approx([0.0, 1 / 60, 2 / 60, 3 / 60], abs=0.004)


def test_what_is_not_as_the_type_says_is_said_with_the_way_out(parts):
    rest, moved, low, aside = parts
    assert any("set blind_s = 0." in sentence for sentence in judged(replace(FOUR, blind_s=0.01), 0.3, parts)[1])
    for turned, axis in (([aside, aside], "x"), ([low, low], "y")):
        (sentence,) = judged(FOUR, 0.3, [rest, moved, *turned])[1]
        assert sentence == f"Its zones do not begin at -{axis}: turn its pose in the skin file."
    still = [replace(one, sample=replace(one.sample, imu=bytes(len(one.sample.imu)))) for one in rest]
    for unmoved in (rest, still):  # the second one's IMU says so to the last digit
        (sentence,) = judged(FOUR, 0.3, [rest, unmoved, low, aside])[1]
        assert sentence.partition(":")[0] == "Its distances did not follow its IMU"
    with pytest.raises(HardwareError, match="not heard for a full second: check its wiring and the network"):
        delays(low[: len(low) // 3])


def test_the_command_asks_for_each_step_and_names_a_unit_that_does_not_move(tmp_path, capsys):
    keys = simulated_keys(("front",), 0)
    save_keys(keys, tmp_path / "keys.toml")
    words = ["--keys", str(tmp_path / "keys.toml"), "--id", "front", "--sensor", PAPER_SENSOR.name, "--distance", "0.5"]
    port = free_port()
    with Desk(keys, port):
        assert main(["skin", "check-unit", *words, "--port", str(port), "--seconds", "4", "--pause", "0.2"]) == 1
    said = capsys.readouterr().out
    assert all(words in said for words in ("Hold a white card at rest 0.5 m before the unit", "did not follow"))
