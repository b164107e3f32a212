import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, GhostSpec, SceneSpec
from pretouch.types import RangeStatus
from pretouch_lab.replay import Ghost

FORWARD = np.array([[0.0, 0.0, 1.0, 0.027], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.03], [0.0, 0.0, 0.0, 1.0]])
"""Pose on the hand whose beam points along +x of the base in the ready posture, from (0.334, 0, 0.560) m."""
RADIUS = 0.1


@pytest.fixture
def haunted(panda_model):
    def make(place, **scene):
        plant = Plant(panda_model, SceneSpec(**scene), PlantParams(), panda_model.description.q_ready, 1000)
        ghost = Ghost(plant, place) if "ghost" in scene else None
        skin = Skin([SensorUnit("front", "panda_hand", FORWARD)], panda_model)
        exact = RangeFinderParams(offset_max_m=0.0, noise_floor_m=0.0, noise_rate=0.0, dropout=0.0)
        return plant, ghost, RangeFinders(plant, skin, exact, 1000)

    return make


def test_a_ghost_is_seen_where_it_is_put(haunted):
    def place(time):
        return np.array([0.334 + (0.3 if time < 0.2 else 0.5) + RADIUS, 0.0, 0.56])

    plant, _, finders = haunted(place, ghost=GhostSpec(RADIUS, (2.0, 0.0, 1.0)))
    for until, distance in ((0.2, 0.3), (0.4, 0.5)):
        plant.advance(until - plant.time - 0.001)
        readings = finders.read()
        assert readings.status[0] == RangeStatus.OK
        assert readings.distance[0] == pytest.approx(distance, abs=0.02)
        np.testing.assert_array_equal(plant.mj_data.mocap_pos[0], place(plant.time - 0.001))


def test_a_ghost_inside_the_arm_touches_nothing_and_changes_no_motion(haunted):
    inside = np.array([0.31, 0.0, 0.55])
    plant, _, _ = haunted(lambda time: inside, ghost=GhostSpec(RADIUS, (2.0, 0.0, 1.0)))
    alone, _, _ = haunted(None)
    for arm in (plant, alone):
        arm.command(np.full(7, 0.1))
        arm.advance(0.3)
    assert not plant.touching
    assert not plant.touches
    np.testing.assert_array_equal(plant.read().q, alone.read().q)
    np.testing.assert_array_equal(plant.read().tau_ext, alone.read().tau_ext)


def test_a_glossy_wall_is_seen_square_and_not_slanted(panda_model):
    slanted = FORWARD.copy()
    slanted[:3, :3] = FORWARD[:3, :3] @ Rotation.from_euler("x", 45, degrees=True).as_matrix()
    units = [SensorUnit("square", "panda_hand", FORWARD), SensorUnit("slanted", "panda_hand", slanted)]
    seen = {}
    for power in (1.0, 20.0):
        scene = SceneSpec(boxes=(Box("wall", (0.884, 0.0, 0.56), (0.05, 3.0, 3.0), 1e4),))
        plant = Plant(panda_model, scene, PlantParams(), panda_model.description.q_ready, 1000)
        finders = RangeFinders(plant, Skin(units, panda_model), RangeFinderParams(slant_power=power, dropout=0.0), 1000)
        plant.advance(0.1)
        seen[power] = (finders.read().status == RangeStatus.OK).tolist()
    assert seen == {1.0: [True, True], 20.0: [True, False]}
