import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from trimesh import Trimesh

from pretouch.importing.capsule_fit import Rods, _slope, covering, farthest_out, fitted, points_around
from pretouch.importing.solids import Block, Cylinder, Rounded, Shape, surface_of
from pretouch.importing.surface_distance import SurfaceDistance


def surface(*solids):
    return SurfaceDistance(surface_of(tuple(Shape(solid, T) for solid, T in solids)))


def pose(rotation_vector=(0, 0, 0), position=(0, 0, 0)):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(rotation_vector).as_matrix(), position
    return T


@settings(max_examples=3)
@given(
    radius=st.floats(0.02, 0.1),
    half=st.floats(0.02, 0.25),
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    place=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_a_capsule_is_found_again(radius, half, turn, place):
    T = pose(turn, place)
    rods = fitted(surface((Rounded(radius, half), T)))
    ends = T[:3, 3] + half * np.outer([-1, 1], T[:3, 2])
    found = np.array([rods.a[0], rods.b[0]])
    assert len(rods) == 1
    assert rods.radius[0] == pytest.approx(radius, abs=1e-3)
    assert min(np.abs(found - ends).max(), np.abs(found[::-1] - ends).max()) < 2e-3


@settings(max_examples=2)
@given(size=st.tuples(*[st.floats(0.02, 0.15)] * 3), turn=st.tuples(*[st.floats(-3, 3)] * 3))
def test_more_capsules_are_never_worse_and_distances_never_far_off(size, turn):
    body = surface((Block(size), pose(turn)))
    points = points_around(body, 2000, 0.002, 0.3, skip=7777)
    wanted = body(points)
    rms = [float(np.sqrt(((fitted(body, most)(points) - wanted) ** 2).mean())) for most in (1, 3)]
    assert rms[1] <= rms[0] + 5e-4
    assert rms[1] < 0.3 * max(size)


def test_a_fit_is_the_same_each_time():
    body = surface((Cylinder(0.05, 0.1), pose()), (Cylinder(0.05, 0.1), pose((0, np.pi / 2, 0), (0.08, 0, 0.1))))
    first, again = fitted(body), fitted(body)
    assert np.array_equal(first.a, again.a)
    assert np.array_equal(first.radius, again.radius)
    assert len(first) > 1


def test_one_triangle_many_times_over_is_no_error():
    corners = np.tile(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]), (50, 1))
    body = SurfaceDistance(Trimesh(corners, np.arange(150).reshape(-1, 3), process=False))
    assert np.isfinite(fitted(body)(np.zeros((1, 3)))).all()


RODS = Rods(np.array([[0, 0, -0.1], [0.1, 0, 0]]), np.array([[0, 0, 0.1], [0.2, 0, 0]]), np.array([0.05, 0.04]))


@pytest.mark.parametrize("solid", [Block((0.06, 0.05, 0.15)), Cylinder(0.07, 0.12)])
def test_what_sticks_out_is_found_between_the_corners_too(solid):
    corners = surface((solid, pose((0.3, 0.4, 0.5)))).corners
    weights = np.random.default_rng(3).dirichlet([1, 1, 1], 3000)
    sampled = RODS(np.concatenate([np.einsum("pk,fki->fpi", weights, corners).reshape(-1, 3), corners.reshape(-1, 3)]))
    found = farthest_out(RODS, corners)
    assert sampled.max() <= found < sampled.max() + 3e-3


def test_what_sticks_out_is_exact_where_it_is_known():
    # halfway between two capsules far from each other, the wall between their axes is farthest out
    rods = Rods(np.array([[0, 0, 0.0], [0.2, 0, 0]]), np.array([[0, 0, 1e-3], [0.2, 0, 1e-3]]), np.array([0.03, 0.03]))
    strip = np.array([[[0.0, 0, 0], [0.2, 0, 0], [0.1, 1e-3, 0]]])
    assert farthest_out(rods, strip) == pytest.approx(np.hypot(0.1, 1e-3) - 0.03, abs=2e-4)
    assert farthest_out(rods, strip[:, :1].repeat(3, axis=1)) == 0.0


def test_capsules_that_cover_leave_nothing_out():
    body = surface((Block((0.05, 0.06, 0.15)), pose((0.3, 0.4, 0.5))))
    before = fitted(body)
    after = covering(before, body.parts)
    assert farthest_out(before, body.corners) > 1e-3
    assert farthest_out(after, body.corners) < 2e-4
    assert (after.radius >= before.radius).all()


def test_the_slope_is_that_of_finite_differences():
    rng = np.random.default_rng(0)
    rods = Rods(rng.normal(size=(2, 3)), rng.normal(size=(2, 3)), np.array([0.1, 0.2]))
    points = rng.normal(size=(40, 3)) * 2
    wanted = np.full(40, -10.0)  # every distance is too long, so that each weighs the same
    found = _slope(rods, points, wanted)
    x = np.column_stack([rods.a, rods.b, rods.radius]).ravel()
    for k in range(14):
        ends = []
        for step in (1e-6, -1e-6):
            table = (x + step * (np.arange(14) == k)).reshape(-1, 7)
            ends.append(Rods(table[:, :3], table[:, 3:6], table[:, 6])(points))
        assert found[:, k] == pytest.approx(1.5 * (ends[0] - ends[1]) / 2e-6, abs=1e-5)
