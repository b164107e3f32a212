"""Postures: how far an arm is from itself, and one that brings the hand to a point."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.stats import qmc

from pretouch.errors import ExperimentError
from pretouch.robot.description import RobotDescription, fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, kinematics_of, segment_distance, self_distances

ARMS = [panda(), fr3()]


def postures(model: RobotModel, count: int) -> np.ndarray:
    return qmc.scale(qmc.Sobol(model.n, rng=7).random(count), model.q_min, model.q_max)


def distances(model: RobotModel, q: np.ndarray) -> np.ndarray:
    return self_distances(model, capsule_ends(model, kinematics_of(model, q)))


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_distances_are_those_mujoco_finds_between_its_geoms(arm: RobotDescription):
    model = RobotModel(arm)
    q = postures(model, 32)
    found = distances(model, q)
    physics = mujoco.MjModel.from_xml_path(str(arm.mjcf))
    data, ends = mujoco.MjData(physics), np.zeros(6)
    for s, row in enumerate(q):
        data.qpos[:] = row
        mujoco.mj_kinematics(physics, data)
        expected = [mujoco.mj_geomDistance(physics, data, int(i), int(j), 5.0, ends) for i, j in model.apart]
        np.testing.assert_allclose(found[s], expected, atol=1e-6)


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_every_pair_comes_apart_somewhere_and_neighbours_are_no_pair(arm: RobotDescription):
    model = RobotModel(arm)
    assert np.all(distances(model, postures(model, 256)).max(axis=0) > 0.05)
    links = {tuple(sorted(pair)) for pair in model.capsules.link[model.apart].tolist()}
    number = model.link_index
    name = arm.name
    assert (number(f"{name}_link5"), number(f"{name}_hand")) in links
    assert (number(f"{name}_link0"), number(f"{name}_link2")) in links
    for one, other in [("link0", "link1"), ("link4", "link5"), ("link6", "hand"), ("link7", "hand")]:
        assert (number(f"{name}_{one}"), number(f"{name}_{other}")) not in links


def test_a_hand_folded_onto_the_forearm_is_in_penetration(panda_model: RobotModel):
    folded = panda_model.description.q_ready.copy()
    folded[5:] = 0.0, -0.3
    assert distances(panda_model, np.array([panda_model.description.q_ready, folded])).min(axis=1)[1] < 0.0
    assert distances(panda_model, panda_model.description.q_ready[None]).min() > 0.03


coordinate = st.one_of(st.floats(-1.0, 1.0), st.sampled_from([0.0, 1.0, 1e-9, 1e-5, -0.5]))
point = st.tuples(coordinate, coordinate, coordinate).map(np.array)


def by_least_squares(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """The nearest points as a bounded least-squares problem."""
    columns = np.column_stack([b - a, c - d])
    best = lsq_linear(columns, c - a, bounds=(0.0, 1.0), method="bvls", tol=1e-14)
    return float(np.linalg.norm(columns @ best.x - (c - a)))


@given(point, point, point, point)
def test_segments_are_as_far_apart_as_least_squares_says(a, b, c, d):
    assert segment_distance(a, b, c, d) == pytest.approx(by_least_squares(a, b, c, d), abs=1e-6)


@given(point, point, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), point)
def test_parallel_segments_too(a, b, begin, end, offset):
    c, d = a + begin * (b - a) + offset, a + end * (b - a) + offset
    assert segment_distance(a, b, c, d) == pytest.approx(by_least_squares(a, b, c, d), abs=1e-6)


@given(point, point, point)
def test_points_are_segments_of_no_length(a, b, c):
    assert segment_distance(a, a, b, b) == pytest.approx(float(np.linalg.norm(a - b)), abs=1e-12)
    assert segment_distance(a, a, b, c) == pytest.approx(float(segment_distance(b, c, a, a)), abs=1e-9)


# the hand brought to a point


def test_the_hand_is_at_the_point_and_as_upright_as_before(panda_model):
    point = np.array([0.5, -0.25, 0.25])
    q = brought_to(panda_model, point)
    kin, ready = panda_model.kinematics(q), panda_model.kinematics(panda_model.description.q_ready)
    ee = panda_model.ee
    np.testing.assert_allclose(kin.position[ee], point, atol=2e-6)
    np.testing.assert_allclose(kin.rotation[ee], ready.rotation[ee], atol=1e-5)
    assert np.all((q > panda_model.q_min) & (q < panda_model.q_max))


def test_a_point_out_of_reach_is_named(panda_model):
    with pytest.raises(ExperimentError, match=r"cannot reach \[2.0, 0.0, 0.5\]"):
        brought_to(panda_model, np.array([2.0, 0.0, 0.5]))
