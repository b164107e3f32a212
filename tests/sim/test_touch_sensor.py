"""Simulated touch sensors: forces laid on the arm and contacts with things, and the faults they have."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.sim.hand import Hand, HandGoal
from pretouch.sim.plant import Plant, PointForce
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.sim.touch_sensor import TouchErrors, TouchSensors
from pretouch.types import TouchStatus

UNIT = 0
EXACT = TouchErrors(
    gain_error=0.0, noise=0.0, noise_floor_n=0.0, hysteresis=0.0, step_n=0.001, latency_s=0.0, jitter_s=0.0,
    dropout=0.0, period_jitter=0.0, rise_s=0.0001,
)  # fmt: skip


def skin_of(paper_skin: Skin, model: RobotModel, patch: TouchPatch | None = None) -> Skin:
    units = list(paper_skin.units)
    units[UNIT] = replace(units[UNIT], touch=patch or TouchPatch())
    return Skin(units, model)


def plant_of(model: RobotModel, scene: SceneSpec | None = None) -> Plant:
    return Plant(model, scene or SceneSpec(), PlantParams(), model.description.q_ready, 0)


class Presser:
    """A force on the arm beside a unit, pressing along the unit's axis, that acts in the simulation as well."""

    def __init__(self, plant: Plant, skin: Skin, beside: float, newtons: float, sign: float = -1.0) -> None:
        self.plant, self.skin, self.beside, self.newtons, self.sign = plant, skin, beside, newtons, sign

    def __call__(self, _time: float) -> list[PointForce]:
        link = int(self.skin.link[UNIT])
        R = self.plant.link_rotation[link] @ self.skin.T_link_sensor[UNIT, :3, :3]
        at = self.plant.link_position[link] + self.plant.link_rotation[link] @ self.skin.T_link_sensor[UNIT, :3, 3]
        return [PointForce(link, at + self.beside * R[:, 0], self.newtons * self.sign * R[:, 2])]


@pytest.fixture
def pressed(panda_model, paper_skin):
    """Make sensors on an arm of its own, and a force beside the unit."""

    def make(params=EXACT, seed=0, patch=None, **force):
        plant, skin = plant_of(panda_model), skin_of(paper_skin, panda_model, patch)
        press = Presser(plant, skin, **{"beside": 0.0, "newtons": 0.0} | force)
        return plant, TouchSensors(plant, skin, params, seed, press), press

    return make


@pytest.mark.parametrize(
    ("beside", "newtons", "sign", "felt"),
    [(0.0, 5.0, -1.0, 5.0), (0.019, 5.0, -1.0, 5.0), (0.021, 5.0, -1.0, 0.0), (0.0, 0.4, -1.0, 0.4),
     (0.0, 5.0, 1.0, 0.0), (0.0, 50.0, -1.0, 10.0)],
)  # fmt: skip
def test_a_force_that_is_laid_on_the_patch_is_felt(pressed, beside, newtons, sign, felt):
    plant, sensors, _ = pressed(beside=beside, newtons=newtons, sign=sign)
    before = sensors.touch()
    assert before.stamp[UNIT] == -np.inf
    assert before.status.tolist() == [TouchStatus.NONE] * 7
    plant.advance(0.1)
    now = sensors.touch()
    assert now.status.tolist() == [TouchStatus.OK] + [TouchStatus.NONE] * 6
    assert now.force[UNIT] == pytest.approx(felt, abs=1e-3)
    assert bool(now.contact[UNIT]) == (felt >= 0.5)
    assert plant.time - now.stamp[UNIT] <= 0.021


def test_a_sensor_of_contact_only_tells_no_force(pressed):
    plant, sensors, _ = pressed(patch=TouchPatch(0.02, 0.5, measures_force=False), newtons=5.0)
    plant.advance(0.1)
    assert sensors.touch().contact[UNIT]
    assert np.isnan(sensors.touch().force[UNIT])


class Pusher:
    """A person who pushes the middle of a unit with a force."""

    def __init__(self, skin: Skin) -> None:
        self.skin = skin

    def goal(self, time, hand, plant):
        link, T = int(self.skin.link[UNIT]), self.skin.T_link_sensor[UNIT]
        unit = plant.link_position[link] + plant.link_rotation[link] @ T[:3, 3]
        outwards = plant.link_rotation[link] @ T[:3, 2]
        return HandGoal(unit + (0.15 if time < 0.8 else -0.1) * outwards, 6.0)


def test_a_hand_that_pushes_on_the_unit_is_felt_with_the_force_of_the_contact(panda_model, paper_skin):
    skin = skin_of(paper_skin, panda_model, TouchPatch(radius_m=0.04))
    q = panda_model.description.q_ready
    kin, link = panda_model.kinematics(q), int(skin.link[UNIT])
    unit = kin.position[link] + kin.rotation[link] @ skin.T_link_sensor[UNIT, :3, 3]
    start = unit + 0.2 * kin.rotation[link] @ skin.T_link_sensor[UNIT, :3, 2]
    plant = plant_of(panda_model, SceneSpec(hand=HandSpec(start=(start[0], start[1], start[2]))))
    Hand(plant, Pusher(skin))
    sensors = TouchSensors(plant, skin, EXACT, 0)
    plant.advance(0.7)
    assert not sensors.touch().contact[UNIT]
    assert plant.contact_forces() == []
    plant.advance(2.0)
    (pressed,) = plant.contact_forces()
    assert pressed.link == link
    np.testing.assert_allclose(pressed.force, plant.true_force)
    assert sensors.touch().contact[UNIT]
    # the person pushes with 6 N along the unit's axis, less what moves the arm's own hand away
    assert sensors.touch().force[UNIT] == pytest.approx(6.0, abs=1.0)


def test_hysteresis_keeps_a_touch_until_well_below_the_smallest_force(pressed):
    (plant, sensors, press), course = pressed(), []
    for newtons in (0.45, 0.55, 0.45, 0.3, 0.45):
        press.newtons = newtons
        plant.advance(0.06)
        course.append(bool(sensors.touch().contact[UNIT]))
    assert course == [False, True, True, False, False]


def test_a_silenced_sensor_says_nothing(pressed):
    plant, sensors, _ = pressed()
    plant.advance(0.1)
    sensors.silenced.add(UNIT)
    last = sensors.touch().stamp[UNIT]
    plant.advance(0.1)
    assert sensors.touch().stamp[UNIT] == last


def test_the_same_seed_gives_the_same_readings(pressed):
    def readings(seed: int) -> list[float]:
        (plant, sensors, _), found = pressed(TouchErrors(), seed, newtons=3.0), []
        for _ in range(20):
            plant.advance(0.01)
            found.append(float(sensors.touch().force[UNIT]))
        return found[5:]

    assert readings(4) == readings(4)
    assert readings(4) != readings(5)
