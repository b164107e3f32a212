from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from pretouch.sim.hand import Hand, HandGoal, PersonArm
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.types import FloatArray

FREE = (1.2, 0.0, 0.8)
"""Where nothing is in the hand's way [m]."""


@dataclass
class Script:
    """A person who wants the hand where `where(time)` says."""

    where: Callable[[float], FloatArray]
    force_max: float = 1000.0

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        return HandGoal(self.where(time), self.force_max)


def stay(point) -> Callable[[float], FloatArray]:
    return lambda time: np.array(point, dtype=float)


@pytest.fixture
def plant_with_hand(panda_model) -> Callable[..., Plant]:
    def make(start: tuple[float, float, float], seed: int = 0) -> Plant:
        spec = SceneSpec(hand=HandSpec(start=start))
        return Plant(panda_model, spec, PlantParams(), panda_model.description.q_ready, seed)

    return make


def each_step(plant: Plant, duration: float, look: Callable[[], object]) -> np.ndarray:
    """What `look` sees after each physics step."""
    return np.array([(plant.advance(0.001), look())[1] for _ in range(round(duration / 0.001))])


def test_a_hand_travels_at_the_speed_of_its_person_and_arrives(plant_with_hand):
    hand = Hand(plant := plant_with_hand(FREE), Script(stay((1.2, 1.0, 0.8))), PersonArm(speed_max=0.5))
    assert hand.position == pytest.approx(np.array(FREE))
    velocity = each_step(plant, 1.9, lambda: plant.hand.velocity.copy())
    assert velocity[200:1800] == pytest.approx(np.tile([0.0, 0.5, 0.0], (1600, 1)), abs=0.01)
    assert np.linalg.norm(velocity, axis=1).max() < 0.6, "the spring lets the mass overshoot by a sixth, not more"
    plant.advance(0.6)
    assert hand.position == pytest.approx([1.2, 1.0, 0.8], abs=1e-3)
    assert plant.hand.velocity == pytest.approx(np.zeros(3), abs=1e-3)


def test_a_disturbed_hand_comes_to_rest(plant_with_hand):
    hand = Hand(plant := plant_with_hand(FREE), Script(stay(FREE)))
    plant.mj_data.qvel[-3:] = [0.5, 0.0, 0.0]
    away = each_step(plant, 0.5, lambda: hand.position[0] - FREE[0])
    # a mass of 0.6 kg on 2000 N/m and 60 N s/m: omega 57.7 1/s, zeta 0.866, crest 0.5 / omega * 0.404
    assert away.max() == pytest.approx(0.0035, rel=0.1)
    assert away.min() > -0.05 * away.max()
    assert np.abs(away[200:]).max() < 1e-4


@pytest.mark.parametrize("force_max", [5.0, 20.0, 40.0])
def test_a_hand_pushes_with_no_more_than_its_force(plant_with_hand, force_max):
    plant = plant_with_hand((0.3069, 0.0, 0.4082))  # 2 cm below the fingertip
    Hand(plant, Script(stay((0.3069, 0.0, 0.5)), force_max), PersonArm(speed_max=0.1))
    applied = each_step(plant, 1.5, lambda: plant.mj_data.qfrc_applied[-3:])
    assert np.linalg.norm(applied, axis=1).max() <= force_max + 1e-9
    assert np.linalg.norm(plant.true_force) == pytest.approx(force_max, rel=0.02)
    assert plant.true_force[2] > 0.9 * force_max
    assert np.linalg.norm(plant.hand.velocity) < 0.02


# Touches


def touched(plant: Plant) -> list[str]:
    return [plant.model.links[touch.link] for touch in plant.touches]


def test_a_push_is_one_touch_and_the_next_one_after_letting_go_another(plant_with_hand):
    plant = plant_with_hand((0.3069, 0.0, 0.4082))
    up, down = np.array([0.3069, 0.0, 0.5]), np.array([0.3069, 0.0, 0.3])
    hand = Hand(plant, Script(lambda time: down if 1.0 < time < 2.0 else up, 30.0), PersonArm(speed_max=0.2))
    plant.advance(0.09)
    assert plant.touches == []
    plant.advance(0.91)
    assert touched(plant) == ["panda_hand"]
    assert plant.true_force[2] == pytest.approx(30.0, rel=0.02)
    assert plant.touches[0].time == pytest.approx(0.1, abs=0.02)  # 2 cm at 0.2 m/s
    assert np.abs(plant.touches[0].velocity).max() < 1e-3  # the arm stood, before the hand came
    # who lets go pulls back at once
    force = each_step(plant, 0.3, lambda: plant.true_force[2])
    assert 0.001 * np.argmax(force == 0.0) < 0.15
    assert hand.position[2] < 0.42
    plant.advance(1.7)
    assert touched(plant) == ["panda_hand", "panda_hand"]
    forces = [(time, force.any()) for time, force in plant.true_log]
    begins = [time for (_, before), (time, now) in pairwise(forces) if now and not before]
    assert [touch.time for touch in plant.touches] == begins


@pytest.mark.parametrize("what", ["a hand that stays", "a box"])
def test_an_arm_that_comes_down_on_something_closes_downwards(panda_model, what):
    hand, table = HandSpec(start=(0.3069, 0.0, 0.3882)), Box("table", (0.3069, 0.0, 0.4182), (0.1, 0.1, 0.02), 10_000.0)
    scene = SceneSpec(boxes=(table,)) if what == "a box" else SceneSpec(hand=hand)
    plant = Plant(panda_model, scene, PlantParams(), panda_model.description.q_ready, 0)
    if scene.hand:
        Hand(plant, Script(stay(hand.start)), PersonArm(speed_max=0.1))
    J = panda_model.ee_jacobian(panda_model.kinematics(panda_model.description.q_ready))
    plant.command(np.linalg.pinv(J) @ [0, 0, -0.1, 0, 0, 0])
    plant.advance(0.5)
    assert touched(plant) == ["panda_hand"]
    assert plant.touches[0].time == pytest.approx(0.4, abs=0.02)
    assert plant.touches[0].velocity == pytest.approx([0.0, 0.0, -0.1], abs=0.01)
    assert plant.true_force[2] > 0.0, "nothing pushes back"


@pytest.mark.parametrize(
    ("start", "link"), [((0.3069, 0.18, 0.5595), "panda_hand"), ((0.15, 0.15, 0.62), "panda_link5")]
)
def test_a_touch_has_the_velocity_of_the_point_that_touches(plant_with_hand, start, link):
    Hand(plant := plant_with_hand(start), Script(stay(start)))
    plant.command(0.3 * np.eye(7)[0])
    plant.advance(0.5)
    assert touched(plant)[0] == link
    around = 0.3 * np.array([-start[1], start[0], 0.0])  # at the middle of the hand, 5 cm from its surface
    assert np.linalg.norm(plant.touches[0].velocity - around) < 0.3 * 0.055
