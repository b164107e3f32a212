"""What arm and hand are drawn by: surfaces of their capsules, or the vendor's."""

import math

import numpy as np
import pytest
import trimesh

from pretouch.page.person import cuff, fist
from pretouch.page.surfaces import EDGE_M, capsule_surfaces, surface_of, vendor_surfaces
from pretouch.robot.body import Capsules, from_axes
from pretouch.sim.scene import HandSpec


def capsule(a: tuple[float, float, float], b: tuple[float, float, float], radius: float) -> Capsules:
    return Capsules(np.zeros(1, np.int64), np.array([a]), np.array([b]), np.array([radius]))


@pytest.mark.parametrize("end", [(0.02, 0.0, 0.1), (0.0, 0.0, 0.1), (0.0, 0.0, -0.3), (0.0, 0.0, -0.1)])
def test_the_surface_of_a_capsule_is_closed_and_encloses_its_volume(end):
    start = (0.0, 0.0, -0.1)
    mesh = surface_of(capsule(start, end, 0.05))
    length = math.dist(start, end)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(math.pi * 0.05**2 * length + 4 / 3 * math.pi * 0.05**3, rel=0.06)
    np.testing.assert_allclose(mesh.centroid, np.add(start, end) / 2, atol=1e-3)


def test_the_surface_of_every_link_lies_on_its_body_dense_enough_to_be_coloured(panda_model):
    surfaces = capsule_surfaces(panda_model)
    assert set(surfaces) == set(panda_model.capsules.link.tolist())
    for link, mesh in surfaces.items():
        shape = panda_model.capsules.of_links(np.array([link]))
        apart = np.linalg.norm(from_axes(mesh.vertices, shape.a, shape.b)[1], axis=2) - shape.radius
        assert np.abs(apart).min(axis=1).max() < 1e-3
        assert mesh.volume > 0
        assert np.percentile(mesh.edges_unique_length, 90) < 1.5 * EDGE_M


def test_an_arm_of_which_there_are_no_surfaces_is_drawn_by_its_capsules_and_a_sentence_says_why(fr3_model):
    meshes, sentence = vendor_surfaces(fr3_model)
    assert meshes == {}
    assert sentence == "The arm is drawn by its capsules, because there are no surfaces for fr3."


def test_every_link_of_a_panda_has_a_surface_near_its_capsules(panda_model):
    meshes, sentence = vendor_surfaces(panda_model)
    assert sentence == ""
    for link in np.unique(panda_model.capsules.link):
        capsules, mesh = panda_model.capsules.of_links(np.array([link])), meshes[int(link)]
        low = (capsules.a - capsules.radius[:, None]).min(axis=0)
        assert (
            mesh.vertices.min(axis=0) > np.minimum(low, (capsules.b - capsules.radius[:, None]).min(axis=0)) - 0.06
        ).all()


# the hand that is seen against the one that is simulated


@pytest.mark.parametrize("radius", [HandSpec.radius, 0.1])
def test_the_fist_fills_the_simulated_ball_and_does_not_leave_it(radius):
    mesh = fist(radius)
    assert np.linalg.norm(mesh.vertices, axis=1).max() < 1.05 * radius
    around = trimesh.creation.icosphere(2).vertices
    farthest = (around @ mesh.vertices.T).max(axis=1)  # how far the fist reaches in each direction
    assert farthest.min() > 0.7 * radius
    assert np.median(farthest) > 0.85 * radius


def test_the_fist_is_turned_outwards_and_small_enough_to_send():
    mesh = fist(0.05)
    ball = 4 / 3 * np.pi * 0.05**3
    assert 0.4 * ball < mesh.convex_hull.volume < ball
    assert mesh.volume > 0
    assert len(mesh.vertices) < 4000


def test_the_cuff_lies_behind_the_fist():
    assert cuff(0.05).vertices[:, 0].max() < -0.02
