"""Postures of a workspace, and the coverage averaged over them."""

import numpy as np
import pytest

from pretouch.coverage.measure import CoverageSetting, covered, postures
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.ways import seen_by
from pretouch.errors import ExperimentError
from pretouch.robot.postures import capsule_ends, ever_apart, kinematics_of, self_distances
from pretouch.sim.scene import SceneSpec, fixtures

ROOM = fixtures(SceneSpec())


def drawn(model, workspace, count=6):
    return postures(model, ROOM, workspace, count, np.random.default_rng(1))[0]


def hands(model, q):
    return np.array([model.kinematics(row).position[model.ee] for row in q])


def test_the_hand_is_on_the_path_all_along_it(panda_model):
    hand = hands(panda_model, drawn(panda_model, "circle", 8))
    np.testing.assert_allclose(hand[:, 0], 0.5, atol=1e-5)
    np.testing.assert_allclose(np.hypot(hand[:, 1], hand[:, 2] - 0.25), 0.25, atol=1e-5)
    assert np.diff(np.sort(np.arctan2(hand[:, 1], hand[:, 2] - 0.25))).max() < 2 * 2 * np.pi / 8
    both = hands(panda_model, drawn(panda_model, "paths", 6))
    assert np.sum(np.isclose(both[:, 0], 0.4, atol=1e-5)) == 3, "half of them on the line"
    _, along = postures(panda_model, ROOM, "circle", 8, np.random.default_rng(1))
    out = hand - np.array([0.5, 0.0, 0.25])
    np.testing.assert_allclose(along, np.cross([1.0, 0.0, 0.0], out) / 0.25, atol=1e-4)


def test_the_whole_range_of_the_joints(panda_model):
    q = drawn(panda_model, "joints")
    assert np.all((q >= panda_model.q_min) & (q <= panda_model.q_max))
    gaps = self_distances(panda_model, capsule_ends(panda_model, kinematics_of(panda_model, q)))
    assert gaps[:, ever_apart(panda_model)].min() > 0


def test_one_posture_is_none_of_a_workspace(panda_model):
    with pytest.raises(ExperimentError, match="The number of postures is 1: give at least 2"):
        drawn(panda_model, "circle", 1)


def test_the_same_seed_gives_the_same_numbers(panda_model, paper_skin):
    setting = CoverageSetting(panda_model, ROOM, CoverageParams(), "circle", 4, 1000)
    sets = [setting.draw(sample)[0] for sample in (0, 0, 1)]
    one, other, fresh = (covered(ways, seen_by(ways, paper_skin)) for ways in sets)
    assert one.links == other.links
    assert fresh.arm.ways != one.arm.ways
