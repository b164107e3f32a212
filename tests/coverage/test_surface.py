"""Points on an arm's surface."""

import numpy as np
import pytest

from pretouch.coverage.surface import surface_of
from pretouch.perception.closest import closest
from pretouch.types import no_obstacles
from tests.coverage.made import RADIUS, arm


def test_points_stand_for_equal_areas_of_a_capsule(tmp_path):
    model = arm(tmp_path)
    surface = surface_of(model, 2000)
    one = surface.only(surface.link == model.link_index("one"))
    assert one.area.sum() == pytest.approx(2 * np.pi * RADIUS * 0.5)
    on_side = (one.point[:, 2] > 0) & (one.point[:, 2] < 0.4)
    assert on_side.mean() == pytest.approx(0.4 / 0.5, abs=0.005), "the rest are its two ends"
    assert np.linalg.norm(one.point[on_side, :2], axis=1) == pytest.approx(RADIUS)
    turn = np.arctan2(one.point[:, 1], one.point[:, 0])
    assert np.histogram(turn, 8, (-np.pi, np.pi))[0] / len(one) == pytest.approx(1 / 8, abs=0.01)


def test_all_points_are_on_the_outside_of_their_link(panda_model):
    surface = surface_of(panda_model, 1500)
    arm_of = panda_model.capsules
    assert set(surface.link) == set(panda_model.parts)
    assert np.linalg.norm(surface.normal, axis=1) == pytest.approx(1.0)
    for link in panda_model.parts:
        own, here = arm_of.of_links(np.array([link])), surface.only(surface.link == link)
        near = no_obstacles(len(here))._replace(point=here.point)
        closest(own, near)
        assert np.abs(near.body_distance).max() < 1e-9
        np.testing.assert_allclose(near.direction, here.normal, atol=1e-6)


def test_another_shift_gives_other_points_of_the_same_areas(panda_model):
    one, other = surface_of(panda_model, 500), surface_of(panda_model, 500, 0.37)
    assert not np.allclose(one.point[:20], other.point[:20])
    assert one.area.sum() == pytest.approx(other.area.sum(), rel=0.05)
