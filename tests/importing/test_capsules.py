"""Capsules in place of surfaces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from trimesh import Trimesh, creation
from trimesh.util import concatenate

from pretouch.importing.capsules import covering, distances, fitted, link_body, outside_of


def placed(solid, turn=(0, 0, 0), place=(0, 0, 0)):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), place
    return solid.apply_transform(T)


def distance(rods, points):
    return distances(rods, points).min(axis=1)


def box(turn=(0.3, 0.4, 0.5)):
    return placed(creation.box([0.1, 0.12, 0.3]), turn)


def box_distance(points, half):
    over = np.abs(points) - half
    return np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0)


@settings(max_examples=3)
@given(
    radius=st.floats(0.02, 0.1),
    half=st.floats(0.02, 0.25),
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    place=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_a_capsule_is_found_again(radius, half, turn, place):
    rods = fitted(outside_of(placed(creation.capsule(2 * half, radius, (24, 48)), turn, place)))
    ends = place + half * np.outer([-1, 1], Rotation.from_rotvec(turn).as_matrix()[:, 2])
    found = rods[0, :6].reshape(2, 3)
    assert len(rods) == 1
    assert rods[0, 6] == pytest.approx(radius, abs=1.5e-3)
    assert min(np.abs(found - ends).max(), np.abs(found[::-1] - ends).max()) < 3e-3


def test_places_about_a_box_are_outside_and_as_high_as_is_said():
    half = np.array([0.05, 0.1, 0.2])
    outside = outside_of(creation.box(2 * half))
    above = box_distance(outside.around, half)
    assert len(outside.around) > 800
    assert (above > 0).mean() > 0.99
    assert outside.height == pytest.approx(np.abs(above), abs=5e-3)
    assert box_distance(outside.on, half) == pytest.approx(np.zeros(len(outside.on)), abs=1e-9)


def test_what_is_within_a_shell_is_not_fitted_to():
    shell = creation.cylinder(0.06, 0.3, sections=48)
    walls = shell.faces[np.abs(shell.face_normals[:, 2]) < 0.5]  # open at both ends, as the links of many arms
    hollow = Trimesh(shell.vertices, walls, process=False)
    full = concatenate([hollow, creation.icosphere(radius=0.04)])
    assert fitted(outside_of(full), 1)[0, 6] == pytest.approx(0.06, abs=4e-3)


@settings(max_examples=2)
@given(size=st.tuples(*[st.floats(0.04, 0.3)] * 3), turn=st.tuples(*[st.floats(-3, 3)] * 3))
def test_more_capsules_are_never_worse_and_distances_never_far_off(size, turn):
    outside = outside_of(placed(creation.box(size), turn))
    rms = [
        float(np.sqrt(((distance(fitted(outside, most), outside.around) - outside.height) ** 2).mean()))
        for most in (1, 3)
    ]
    assert rms[1] <= rms[0] + 5e-4
    assert rms[1] < 0.15 * max(size)


def test_a_fit_is_the_same_each_time():
    parts = [creation.cylinder(0.05, 0.2), placed(creation.cylinder(0.05, 0.2), (0, np.pi / 2, 0), (0.08, 0, 0.1))]
    first, again = (fitted(outside_of(concatenate(parts)), 2) for _ in range(2))
    assert np.array_equal(first, again)
    assert len(first) > 1


def test_a_flat_surface_gets_capsules():
    surface = Trimesh([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]], [[0, 1, 2]], process=False)
    assert np.isfinite(distance(fitted(outside_of(surface)), np.zeros((1, 3)))).all()


def test_what_sticks_out_is_that_of_the_corners_of_a_box_and_covering_leaves_none():
    outside = outside_of(box())
    found = link_body("box", outside, None, 1)
    assert found.sticks_out == pytest.approx(distance(found.rods, box().vertices).max())
    assert found.sticks_out > 1e-3
    assert 1e-3 < found.stands_over < 0.05
    covered = link_body("box", outside, None, 1, cover=True)
    assert covered.sticks_out < 1e-9
    assert (covered.rods[:, 6] >= found.rods[:, 6]).all()
    inside = np.random.default_rng(3).dirichlet([1, 1, 1], 500) @ box().triangles
    assert distance(covering(fitted(outside), outside.on), inside.reshape(-1, 3)).max() < 1e-3
