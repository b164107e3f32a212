import mujoco
import numpy as np
import pytest

from pretouch.perception.closest import closest_points
from pretouch.robot.description import panda
from pretouch_lab.bench.obstacle import Ball, Cuboid, least_distance, nearest


def test_distances_from_a_ball_and_a_box_by_numbers():
    distance, to = Ball(np.array([0.0, 0.0, 1.0]), 0.2).closest(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.9]]))
    np.testing.assert_allclose(distance, [0.8, -0.1])
    np.testing.assert_allclose(to, [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    box = Cuboid(np.zeros(3), np.array([1.0, 2.0, 3.0]))
    distance, to = box.closest(np.array([[2.0, 0.0, 0.0], [4.0, 6.0, 0.0], [0.9, 0.0, 0.0]]))
    np.testing.assert_allclose(distance, [1.0, 5.0, -0.1])
    np.testing.assert_allclose(to, [[-1.0, 0.0, 0.0], [-0.6, -0.8, 0.0], [-1.0, 0.0, 0.0]])


@pytest.mark.parametrize("center", [[0.3, -0.5, 0.6], [0.6, 0.1, 0.4], [0.0, 0.3, 0.6]])
def test_the_nearest_point_of_the_arm_to_a_ball_is_that_of_the_controllers_own_geometry(panda_model, center):
    kin = panda_model.kinematics(panda_model.description.q_ready)
    ball = Ball(np.array(center), 0.05)
    ours = nearest(kin, panda_model.body, ball)
    aside = np.array([[0.0, 0.0, 1.0]])
    other = closest_points(kin, panda_model.body, np.zeros(3), np.zeros(1, np.int64), ball.center[None], aside)
    assert ours.distance == pytest.approx(float(other.body_distance[0]) - 0.05, abs=1e-3)
    assert ours.link == other.link[0]
    np.testing.assert_allclose(ours.direction, other.direction[0], atol=0.05)


def test_the_least_distance_of_many_postures_is_that_of_each_alone(panda_model):
    rng = np.random.default_rng(7)
    q = panda_model.description.q_ready + 0.3 * rng.standard_normal((30, 7))
    hands = np.array([0.0, 0.4, 0.5]) + 0.3 * rng.standard_normal((30, 3))
    box = Cuboid(np.array([0.7, 0.3, 0.5]), np.array([0.1, 0.2, 0.3]))
    for shape in (lambda hand: Ball(hand, 0.05), lambda _: box):
        each = [
            nearest(panda_model.kinematics(a), panda_model.body, shape(b)).distance
            for a, b in zip(q, hands, strict=True)
        ]
        assert least_distance(panda_model, q, shape, hands) == pytest.approx(min(each), abs=1e-12)


def test_the_nearest_point_of_the_arm_to_a_box_is_that_of_mujoco(panda_model):
    """Both shapes are convex, and MuJoCo finds their distance in another way."""
    center, half_size = (0.5, 0.35, 0.4), (0.15, 0.02, 0.12)
    spec = mujoco.MjSpec.from_file(str(panda().mjcf))
    box = mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(name="object", type=box, pos=center, size=half_size, contype=1, conaffinity=1)
    model = spec.compile()
    data, rng, target = mujoco.MjData(model), np.random.default_rng(8), model.geom("object").id
    moved = {panda_model.links[i] for i in panda_model.body.link}
    geoms = [g for g in range(model.ngeom) if model.body(int(model.geom_bodyid[g])).name in moved]
    shape = Cuboid(np.array(center), np.array(half_size))
    for _ in range(20):
        q = rng.uniform(panda_model.q_min, panda_model.q_max)
        data.qpos[: panda_model.n] = q
        mujoco.mj_kinematics(model, data)
        expected = min(mujoco.mj_geomDistance(model, data, g, target, 2.0, None) for g in geoms)
        ours = nearest(panda_model.kinematics(q), panda_model.body, shape).distance
        assert ours == pytest.approx(expected, abs=1e-3) or (ours < 0 and expected < 0)
