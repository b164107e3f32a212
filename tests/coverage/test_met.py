"""What stands in the way of the moving arm: where it is met, and how often."""

import numpy as np
import pytest

from pretouch.coverage.measure import CoverageSetting, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.ways import seen_by, ways_met
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.postures import brought_to
from pretouch.sensing.sensor import VL53L7CX
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.scene import SceneSpec, fixtures

ROOM = fixtures(SceneSpec())
PARAMS = CoverageParams().standing()


@pytest.fixture(scope="module")
def surface(panda_model):
    return panda_model.surface


@pytest.fixture(scope="module")
def hand(panda_model, surface):
    """Points of the links that nothing moves on its own beside the last joint."""
    return panda_model.moved_by.all(axis=1)[surface.link]


def ready(model):
    return model.description.q_ready[None]


def normals(model, surface):
    R = model.kinematics(model.description.q_ready).rotation[surface.link]
    return np.einsum("pij,pj->pi", R, surface.normal)


def test_the_hand_meets_what_lies_ahead_as_often_as_its_surface_faces_it(panda_model, surface, hand):
    to = np.array([0.6, 0.0, -0.8])
    met = ways_met(panda_model, no_fixtures(), PARAMS, ready(panda_model), to[None])
    ahead = normals(panda_model, surface) @ to
    came = hand & met.free[0]
    assert 0.1 < came[hand].mean() < 0.6
    np.testing.assert_allclose(met.way[0, hand & (met.weight[0] > 0)], np.tile(to, (came.sum(), 1)), atol=2e-3)
    np.testing.assert_allclose(met.weight[0, came], ahead[came], atol=2e-3)
    assert not np.any(met.free[0] & hand & (ahead < -2e-3)), "nothing is met by what moves away"


def test_points_move_as_the_arm_turns(panda_model, surface):
    """Against a difference of two postures: the hand goes 1 mm down, and its pose is found again."""
    q, down, step = panda_model.description.q_ready, np.array([0.0, 0.0, -1.0]), 1e-3
    at = panda_model.kinematics(q)
    later = panda_model.kinematics(brought_to(panda_model, at.position[panda_model.ee] + step * down))
    ends = [k.position[surface.link] + np.einsum("pij,pj->pi", k.rotation[surface.link], surface.point)
            for k in (at, later)]  # fmt: skip
    velocity = (ends[1] - ends[0]) / step
    met = ways_met(panda_model, no_fixtures(), PARAMS, q[None], down[None])
    onto = np.einsum("pi,pi->p", velocity, normals(panda_model, surface))
    free = met.free[0]
    assert free.sum() > 50
    np.testing.assert_allclose(met.weight[0, free], onto[free], atol=0.02)


@pytest.mark.parametrize(("ahead", "low", "high"), [(1.0, 0.3, 1.0), (-1.0, 0.0, 0.0)])
def test_a_unit_at_the_hands_side_sees_what_that_side_meets(panda_model, surface, ahead, low, high):
    """And nothing of what the other side meets."""
    T = np.eye(4)
    T[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    T[:3, 3] = 0.0, 0.115, 0.045
    skin = Skin([SensorUnit("side", "panda_hand", T, sensor=VL53L7CX())], panda_model)
    R = panda_model.kinematics(panda_model.description.q_ready).rotation[panda_model.link_index("panda_hand")]
    met = ways_met(panda_model, ROOM, PARAMS, ready(panda_model), ahead * R[None, :, 1])
    links = {one.name: one.ways for one in covered(met, seen_by(met, skin)).links}
    assert low <= links["panda_hand"] <= high


def test_a_skin_is_measured_along_its_path_or_in_any_direction(panda_model, paper_skin):
    for workspace in ("circle", "joints"):
        setting = CoverageSetting(panda_model, ROOM, CoverageParams(), workspace, 6, 3)
        _, met, _ = setting.draw()
        tip = np.flatnonzero(panda_model.moved_by.all(axis=1)[met.surface.link])
        fast = met.way[:, tip][met.free[:, tip]]
        assert np.all(np.abs(fast[:, 0]) < 0.02) == (workspace == "circle"), "the circle lies across x"
        one, other = (covered(found, seen_by(found, paper_skin)) for found in (met, setting.draw()[1]))
        assert one.links == other.links
        assert 0.0 < one.arm.ways < 0.6


def test_all_axes_of_the_hand_count_alike(panda_model, surface, hand):
    *_, ways = CoverageSetting(panda_model, ROOM, CoverageParams(), "line", 2, 3).draw()
    np.testing.assert_allclose(ways.share.sum(axis=1), 1 / 12)
    assert not ways.share[:, ~hand].any()
    axis = ways.postures[0].rotation[panda_model.ee][:, 2]
    np.testing.assert_allclose(ways.way[2, hand & ways.free[2]] @ axis, 1.0, atol=1e-3)
