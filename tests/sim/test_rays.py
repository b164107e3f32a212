import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sim.rays import cast, geoms_of
from pretouch.sim.scene import ArmError, Box, GhostSpec, HandSpec, SceneSpec, build

ROOM = SceneSpec(
    boxes=(Box("object", (0.5, 0.3, 0.4), (0.15, 0.02, 0.12), 25e3),), hand=HandSpec(), ghost=GhostSpec(0.1, (0, 0, 0))
)


@pytest.mark.parametrize("farthest", [0.3, 1.3, 4.0])
def test_rays_meet_what_mujoco_finds_to_the_bit_anywhere_in_the_room(panda_model: RobotModel, farthest: float):
    built = build(panda_model, ROOM, ArmError(np.ones(len(panda_model.links)), 0.1, 0.1))
    data, rng, cone = mujoco.MjData(built), np.random.default_rng(0), cone_rays(2, PAPER_SENSOR.angle)
    geoms, met = geoms_of(built, data), 0
    hit, normal, geom = np.zeros(len(cone)), np.zeros((len(cone), 3)), np.zeros(len(cone), np.int32)
    for _ in range(400):
        data.qpos[:7], data.qpos[7:] = rng.uniform(panda_model.q_min, panda_model.q_max), rng.uniform(-0.6, 0.6, 3)
        data.mocap_pos[:] = rng.uniform(-0.7, 0.7, (1, 3))
        mujoco.mj_kinematics(built, data)
        link = int(rng.integers(len(panda_model.links)))
        # on the link's surface, inside it, or a little away
        origin = data.xpos[link] + rng.normal(0.0, 0.07, 3)
        rays = np.ascontiguousarray(cone @ Rotation.random(rng=rng).as_matrix().T)
        mujoco.mj_multiRay(
            built, data, origin, rays.reshape(-1), None, True, link, geom, hit, normal.reshape(-1), len(rays), farthest
        )
        distance, outwards, which = cast(origin, rays, geoms, link, farthest)
        within = (hit >= 0.0) & (hit <= farthest)
        assert np.array_equal(within, (distance >= 0.0) & (distance <= farthest))
        assert np.array_equal(distance[within], hit[within])
        assert np.array_equal(outwards[within], normal[within])
        assert np.array_equal(which[within], geom[within])
        met += int(within.sum())
    assert met > 1000


def test_what_is_transparent_is_not_met(panda_model: RobotModel):
    built = build(panda_model, SceneSpec(), ArmError(np.ones(len(panda_model.links)), 0.1, 0.1))
    data, down = mujoco.MjData(built), np.array([[0.0, 0.0, -1.0]])
    mujoco.mj_kinematics(built, data)
    origin = np.array([1.5, 0.0, 0.3])
    assert cast(origin, down, geoms_of(built, data), -1, 4.0)[0] == pytest.approx([0.5])
    built.geom("floor").rgba[3] = 0.0
    assert cast(origin, down, geoms_of(built, data), -1, 4.0)[0] == [-1.0]
