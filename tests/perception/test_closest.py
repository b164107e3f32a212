import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.perception.closest import closest_points
from pretouch.robot.body import Capsules
from pretouch.robot.description import panda
from pretouch.robot.kinematics import Kinematics
from pretouch.types import Obstacles

ROD = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.1
"""A capsule along z from 0 to 1 m, 0.1 m thick."""
UP = (0.0, 0.0, 1.0)
vectors = arrays(np.float64, 3, elements=st.floats(-2, 2))
radii = st.floats(0.01, 0.5)


def _still(links: int = 1) -> Kinematics:
    return Kinematics(np.zeros((links, 3)), np.tile(np.eye(3), (links, 1, 1)), np.zeros((0, 3)), np.zeros((0, 3)))


def _body(*capsules) -> Capsules:
    a, b, radius = (np.array(part, dtype=np.float64) for part in zip(*capsules, strict=True))
    return Capsules(np.zeros(len(radius), np.int64), a, b, radius)


def _closest(body: Capsules, *points, last=UP, kin: Kinematics | None = None) -> Obstacles:
    p = np.array(points, dtype=np.float64).reshape(-1, 3)
    return closest_points(kin or _still(), body, np.zeros(3), np.arange(len(p)), p, np.tile(last, (len(p), 1)))


@pytest.mark.parametrize(
    ("point", "body_point", "direction", "distance"),
    [
        ((0.5, 0.0, 0.3), (0.1, 0.0, 0.3), (1, 0, 0), 0.4),  # beside it
        ((0.0, 0.0, 1.7), (0.0, 0.0, 1.1), (0, 0, 1), 0.6),  # above its end
        ((0.0, -0.3, -0.4), (0.0, -0.06, -0.08), (0, -0.6, -0.8), 0.4),  # off its other end
        ((0.1, 0.0, 0.5), (0.1, 0.0, 0.5), (1, 0, 0), 0.0),  # on its surface
        ((0.0, 0.03, 0.5), (0.0, 0.1, 0.5), (0, 1, 0), -0.07),  # inside
    ],
)
def test_closest_point_of_a_rod(point, body_point, direction, distance):
    found = _closest(_body(ROD), point)
    np.testing.assert_allclose(found.body_point, [body_point], atol=1e-12)
    np.testing.assert_allclose(found.direction, [direction], atol=1e-12)
    np.testing.assert_allclose(found.body_distance, [distance], atol=1e-12)


@pytest.mark.parametrize("off", [1e-8, 1e-6, 1e-3, 0.099, 0.1, 0.101, 1.0])
def test_the_direction_does_not_turn_on_the_way_through_the_surface(off):
    found = _closest(_body(ROD), (0.6 * off, 0.8 * off, 0.5))
    np.testing.assert_allclose(found.direction, [[0.6, 0.8, 0.0]], atol=1e-9)
    assert found.body_distance == pytest.approx(off - 0.1)


def test_a_capsule_of_no_length_is_a_ball():
    ball = _body(((1, 1, 1), (1, 1, 1), 0.2))
    found = _closest(ball, (1, 1, 1.5), (1, 1, 1))
    np.testing.assert_allclose(found.body_distance, [0.3, -0.2])
    np.testing.assert_allclose(found.direction, [UP, UP])


def test_the_least_signed_distance_wins():
    # inside both balls: 0.05 m deep in the first, 0.1 m in the second
    first, second = ((0, 0, 0), (0, 0, 0), 0.2), ((0.4, 0, 0), (0.4, 0, 0), 0.35)
    assert _closest(_body(first, second), (0.15, 0, 0)).body_distance == pytest.approx(-0.1)
    assert _closest(_body(second, first), (0.15, 0, 0)).body_distance == pytest.approx(-0.1)


def test_a_point_that_is_none_still_names_a_link():
    body = Capsules(np.array([3]), np.zeros((1, 3)), np.ones((1, 3)), np.ones(1))
    found = _closest(body, (np.nan, 0, 0), kin=_still(4))
    np.testing.assert_array_equal(found.link, [3])
    np.testing.assert_array_equal(found.direction, [UP])
    assert np.isnan(found.body_distance)


@given(a=vectors, b=vectors, radius=radii, share=st.floats(0, 1), last=vectors)
def test_the_answer_is_whole_even_on_the_axis(a, b, radius, share, last):
    length = np.linalg.norm(last)
    last = last / length if length > 1e-3 else np.array(UP)
    point = a + share * (b - a)
    found = _closest(_body((a, b, radius)), point, last=last)
    assert found.body_distance == pytest.approx(-radius, abs=1e-9)
    assert np.linalg.norm(found.direction) == pytest.approx(1.0)
    np.testing.assert_allclose(found.body_point + found.body_distance * found.direction, [point], atol=1e-8)


@given(a=vectors, b=vectors, radius=radii, point=vectors)
def test_no_point_of_the_axis_is_closer(a, b, radius, point):
    found = _closest(_body((a, b, radius)), point)
    sampled = np.linalg.norm(a + np.linspace(0, 1, 2001)[:, None] * (b - a) - point, axis=1).min() - radius
    half_step = np.linalg.norm(b - a) / 4000
    assert sampled - half_step - 1e-9 <= found.body_distance[0] <= sampled + 1e-9
    np.testing.assert_allclose(found.body_point + found.body_distance[:, None] * found.direction, [point], atol=1e-8)


@given(
    body=st.lists(st.tuples(vectors, vectors, radii), min_size=1, max_size=4),
    point=vectors,
    step=arrays(np.float64, 3, elements=st.floats(-1e-3, 1e-3)),
)
def test_distance_grows_no_faster_than_the_obstacle_moves(body, point, step):
    found = _closest(_body(*body), point, point + step)
    assert abs(found.body_distance[1] - found.body_distance[0]) <= np.linalg.norm(step) + 1e-12


@pytest.fixture(scope="module")
def arm_and_ball():
    """MuJoCo's own model of the arm, with a ball to measure distances to."""
    spec = mujoco.MjSpec.from_file(str(panda().mjcf))
    spec.worldbody.add_body(name="ball", mocap=True).add_geom(name="ball", size=[1e-3, 0, 0])
    model = spec.compile()
    return model, mujoco.MjData(model)


@given(
    fraction=arrays(np.float64, 7, elements=st.floats(0, 1)), point=arrays(np.float64, 3, elements=st.floats(-0.8, 1.0))
)
def test_distance_to_the_arm_is_that_of_mujoco(panda_model, arm_and_ball, fraction, point):
    model, data = arm_and_ball
    q = panda_model.q_min + fraction * (panda_model.q_max - panda_model.q_min)
    data.qpos[:], data.mocap_pos[0] = q, point
    mujoco.mj_kinematics(model, data)
    ball = model.geom("ball").id
    distance = {
        g: mujoco.mj_geomDistance(model, data, g, ball, 5.0, None) + 1e-3
        for g in range(model.ngeom)
        if model.geom_bodyid[g] in panda_model.body.link
    }
    nearest = min(distance, key=distance.get)
    found = _closest(panda_model.body, point, kin=panda_model.kinematics(q))
    assert found.body_distance == pytest.approx(distance[nearest], abs=1e-9)
    on_same_link = [d for g, d in distance.items() if model.geom_bodyid[g] == found.link[0]]
    assert min(on_same_link) == pytest.approx(distance[nearest], abs=1e-9)
