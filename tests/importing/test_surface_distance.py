import numpy as np
import pytest
import trimesh

from pretouch.importing.capsule_fit import points_around
from pretouch.importing.sampling import directions, spread
from pretouch.importing.solids import Block, Cylinder, Ellipsoid, Rounded, Shape, surface_of
from pretouch.importing.surface_distance import SurfaceDistance, triangle_distance

RNG = np.random.default_rng(4)


def surface(solid, T=None):
    return SurfaceDistance(surface_of((Shape(solid, np.eye(4) if T is None else T),)))


def box_distance(points, half):
    over = np.abs(points) - half
    return np.linalg.norm(np.maximum(over, 0), axis=1) + np.minimum(over.max(axis=1), 0)


def test_distances_to_a_box_are_exact_inside_and_outside():
    half = np.array([0.05, 0.1, 0.2])
    points = RNG.uniform(-0.4, 0.4, (2000, 3))
    wanted, found = box_distance(points, half), surface(Block(tuple(half)))
    assert found(points) == pytest.approx(np.abs(wanted), abs=1e-12)
    assert (found.outside(points) == (wanted > 0)).all()


@pytest.mark.parametrize(("solid", "a"), [(Rounded(0.05, 0.1), 0.1), (Rounded(0.05, 0.0), 0.0)])
def test_distances_to_a_capsule_are_off_by_its_corners_only(solid, a):
    points = RNG.uniform(-0.4, 0.4, (2000, 3))
    axis = np.zeros_like(points)
    axis[:, 2] = np.clip(points[:, 2], -a, a)
    wanted = np.linalg.norm(points - axis, axis=1) - solid.radius
    assert np.where(surface(solid).outside(points), 1, -1) * surface(solid)(points) == pytest.approx(wanted, abs=5e-4)


@pytest.mark.parametrize("solid", [Cylinder(0.05, 0.1), Ellipsoid((0.03, 0.05, 0.1)), Block((0.1, 0.2, 0.3))])
def test_a_solid_is_closed_and_faces_outwards(solid):
    triangles = surface_of((Shape(solid, np.eye(4)),))
    edges = np.sort(np.concatenate([triangles.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    corners = triangles.triangles
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    wanted = {Cylinder: np.pi * 0.05**2 * 0.2, Ellipsoid: 4 / 3 * np.pi * 0.03 * 0.05 * 0.1, Block: 0.048}[type(solid)]
    assert len(edges) == 3 * len(triangles.faces)
    assert volume == pytest.approx(wanted, rel=0.01)


def test_nothing_is_missed_by_leaving_far_triangles_out():
    soup = RNG.normal(size=(60, 3, 3)) * 0.3
    points = RNG.normal(size=(150, 3))
    found = SurfaceDistance(trimesh.Trimesh(**trimesh.triangles.to_kwargs(soup), process=False))
    each = [triangle_distance(np.repeat(p[None], 60, axis=0), soup).min() for p in points]
    assert found(points) == pytest.approx(np.array(each), abs=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1e-4])
def test_the_distance_to_a_triangle_is_as_exact_where_it_is_small(size):
    triangles, points = RNG.normal(size=(200, 3, 3)), RNG.normal(size=(200, 3))
    large, small = triangle_distance(points, triangles), triangle_distance(size * points, size * triangles)
    assert small / size == pytest.approx(large, abs=1e-9)


def test_the_distance_to_a_triangle_is_that_of_its_nearest_sample():
    triangle = RNG.normal(size=(3, 3))
    u = RNG.dirichlet([0.5, 0.5, 0.5], 200_000)
    for point in RNG.normal(size=(20, 3)) * 2:
        sampled = np.linalg.norm(u @ triangle - point, axis=1).min()
        found = triangle_distance(point[None], triangle[None])[0]
        assert found <= sampled + 1e-12
        assert found == pytest.approx(sampled, abs=0.02)


def test_points_around_are_outside_and_the_same_each_time():
    box = surface(Block((0.05, 0.1, 0.2)))
    first, again = (points_around(box, 800, 0.002, 0.3) for _ in range(2))
    assert np.array_equal(first, again)
    assert len(first) > 400
    assert (box_distance(first, [0.05, 0.1, 0.2]) > 0).all()


def test_points_are_spread_evenly():
    u = spread(4000, 6)
    assert u.mean(axis=0) == pytest.approx(np.full(6, 0.5), abs=0.02)
    assert np.corrcoef(u.T) == pytest.approx(np.eye(6), abs=0.05)
    assert directions(u[:, :2]).mean(axis=0) == pytest.approx(np.zeros(3), abs=0.02)
