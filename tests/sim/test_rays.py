"""Rays beside those of MuJoCo itself."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.sim.ranging import NO_ERROR

from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sim.plant import Plant
from pretouch.sim.rays import cast, geoms_of
from pretouch.sim.scene import Box, HandSpec, SceneSpec


@pytest.fixture
def plant(panda_model):
    boxes = Box("board", (0.5, 0.3, 0.4), (0.15, 0.02, 0.12), 1e5), Box("post", (-0.5, -0.5, 0.3), (0.1, 0.1, 0.3), 1e5)
    scene = SceneSpec(boxes, HandSpec(radius=0.1, start=(0.4, -0.2, 0.5)))
    return Plant(panda_model, scene, NO_ERROR, panda_model.description.q_ready.copy(), seed=0)


@pytest.mark.parametrize("farthest", [0.3, 1.3, 4.0])
def test_rays_meet_what_mujoco_finds_to_the_bit_anywhere(plant, farthest):
    built, data, rng, cone = plant.mj_model, plant.mj_data, np.random.default_rng(0), cone_rays(2, PAPER_SENSOR.angle)
    geoms, met = geoms_of(built, data), set()
    hit, normal, geom = np.zeros(len(cone)), np.zeros((len(cone), 3)), np.zeros(len(cone), np.int32)
    for _ in range(1000):
        data.qpos[:7] = rng.uniform(plant.model.q_min, plant.model.q_max)
        mujoco.mj_kinematics(built, data)
        # on a link's surface, inside it, a little away, or anywhere
        link = int(rng.integers(-1, len(plant.model.links)))
        origin = data.xpos[link] + rng.normal(0.0, 0.07, 3) if link >= 0 else rng.uniform(-1.0, 1.0, 3)
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
        met |= set(built.geom_type[which[within]].tolist())
    assert met == {int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("PLANE", "CAPSULE", "SPHERE", "BOX")}


def test_what_is_transparent_is_not_met(plant):
    origin, down = np.array([1.5, 0.0, 0.3]), np.array([[0.0, 0.0, -1.0]])
    assert cast(origin, down, geoms_of(plant.mj_model, plant.mj_data), -1, 4.0)[0] == pytest.approx([0.5])
    plant.mj_model.geom("floor").rgba[3] = 0.0
    assert cast(origin, down, geoms_of(plant.mj_model, plant.mj_data), -1, 4.0)[0] == [-1.0]
