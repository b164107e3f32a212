"""What stands in the way of the moving arm: where it is met, and how often."""

import numpy as np
import pytest

from pretouch.coverage.measure import CoverageSetting, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.ways import seen_by, ways_met
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.postures import brought_to
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


def normals(model, surface):
    R = model.kinematics(model.description.q_ready).rotation[surface.link]
    return np.einsum("pij,pj->pi", R, surface.normal)


def test_the_hand_meets_what_lies_ahead_as_often_as_its_surface_faces_it(panda_model, surface, hand):
    to = np.array([0.6, 0.0, -0.8])
    met = ways_met(panda_model, no_fixtures(), PARAMS, panda_model.description.q_ready[None], to[None])
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


def test_all_directions_of_the_hand_count_alike(panda_model, hand):
    *_, ways = CoverageSetting(panda_model, ROOM, CoverageParams(), "line", 2, 3).draw()
    np.testing.assert_allclose(ways.share.sum(axis=1), 1 / 12)
    assert not ways.share[:, ~hand].any()
    # the hand does not turn: one direction for all its points, and three axes at right angles, both ways
    to = np.array([way[hand & free].mean(axis=0) for way, free in zip(ways.way, ways.free, strict=True)])
    np.testing.assert_allclose(to[:3] @ to[:3].T, np.eye(3), atol=2e-3)
    np.testing.assert_allclose(to[3:6], -to[:3], atol=2e-3)
