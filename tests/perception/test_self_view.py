"""The arm itself, seen by a unit that is not quite where it is believed to be."""

import numpy as np
import pytest
from tests.perception.watcher import HAND_LEFT, Watcher

from pretouch.params import PerceptionParams
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import Fixtures, expected_range, no_fixtures
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sensing.skin import LIVE_SKIN, Skin, load_skin
from pretouch.sim.random_skin import Misplacement, misplaced
from pretouch.types import FloatArray


def shown_by(model: RobotModel, skin: Skin, q: FloatArray, fixtures: Fixtures, distance: dict[str, float]) -> int:
    """How many obstacles units show that read a distance [m]."""
    watcher = Watcher(model, skin, fixtures, PerceptionParams(self_aside_m=0.005))
    watcher.q = q
    return len(watcher.see(1.0, **distance).unit)


def test_units_a_little_elsewhere_do_not_take_their_own_arm_for_an_obstacle(panda_model):
    rng, placed_by_hand = np.random.default_rng(5), Misplacement(5.0, 3.0)
    shown, readings = 0, 0
    for seed in range(10):
        truly = load_skin(LIVE_SKIN, panda_model)
        believed = misplaced(truly, panda_model, placed_by_hand, seed)[0]
        for _ in range(50):
            q = rng.uniform(panda_model.q_min, panda_model.q_max)
            kin = panda_model.kinematics(q)
            at = expected_range(
                kin, placed_sensors(truly.arrays, kin), truly.cones, panda_model.capsules, no_fixtures()
            )
            near = {u: max(d, PAPER_SENSOR.nearest_m) for u, d in zip(truly.ids, at, strict=True) if d < 0.3}
            readings += len(near)
            shown += shown_by(panda_model, believed, q, no_fixtures(), near)
    assert readings > 1000
    assert shown < 10  # 46 without the allowance


@pytest.mark.parametrize(("distance", "shown"), [(0.05, 1), (0.13, 1), (0.15, 0), (0.25, 0), (0.27, 1), (0.5, 1)])
def test_what_is_barely_missed_explains_what_is_about_there_and_hides_nothing(panda_model, paper_skin, distance, shown):
    # a post whose surface lies 3 mm outside of the cone, 0.2 m before the unit of the hand that looks along +y
    edge = 0.2 * np.tan(PAPER_SENSOR.angle / 2) + 0.003 / np.cos(PAPER_SENSOR.angle / 2)
    post = HAND_LEFT + np.array([0.0, 0.2, edge + 0.01 / np.cos(PAPER_SENSOR.angle / 2)])
    ends = post[None] - np.array([0.3, 0, 0]), post[None] + np.array([0.3, 0, 0])
    beside = Fixtures(np.zeros((0, 4)), Capsules(np.zeros(1, np.int64), *ends, np.full(1, 0.01)))
    q = panda_model.description.q_ready
    assert shown_by(panda_model, paper_skin, q, beside, {"hand_left": distance}) == shown
