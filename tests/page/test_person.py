"""The hand that is seen against the one that is simulated."""

import numpy as np
import pytest
import trimesh

from pretouch.page.person import cuff, fist
from pretouch.sim.scene import HandSpec


@pytest.mark.parametrize("radius", [HandSpec.radius, 0.1])
def test_the_fist_fills_the_simulated_ball_and_does_not_leave_it(radius: float) -> None:
    mesh = fist(radius)
    reach = np.linalg.norm(mesh.vertices, axis=1)
    assert reach.max() < 1.05 * radius
    around = trimesh.creation.icosphere(2).vertices
    farthest = (around @ mesh.vertices.T).max(axis=1)  # how far the fist reaches in each direction
    assert farthest.min() > 0.7 * radius
    assert np.median(farthest) > 0.85 * radius


def test_the_fist_is_turned_outwards_and_small_enough_to_send() -> None:
    mesh = fist(0.05)
    ball = 4 / 3 * np.pi * 0.05**3
    assert 0.4 * ball < mesh.convex_hull.volume < ball
    assert mesh.volume > 0
    assert len(mesh.vertices) < 4000


def test_the_cuff_lies_behind_the_fist() -> None:
    assert cuff(0.05).vertices[:, 0].max() < -0.02
