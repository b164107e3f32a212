import io
import math

import numpy as np
import pytest
import trimesh

from pretouch.robot.body import Capsules, from_axes
from pretouch.robot.model import RobotModel
from pretouch.viewer.arm import capsule_surfaces, coloured
from pretouch.viewer.surface import EDGE_M, surface_of


def capsule(a: tuple[float, float, float], b: tuple[float, float, float], radius: float) -> Capsules:
    return Capsules(np.zeros(1, np.int64), np.array([a]), np.array([b]), np.array([radius]))


@pytest.mark.parametrize("end", [(0.02, 0.0, 0.1), (0.0, 0.0, 0.1), (0.0, 0.0, -0.3), (0.0, 0.0, -0.1)])
def test_the_surface_of_a_capsule_is_closed_and_encloses_its_volume(end: tuple[float, float, float]) -> None:
    start = (0.0, 0.0, -0.1)
    mesh = surface_of(capsule(start, end, 0.05))
    length = math.dist(start, end)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(math.pi * 0.05**2 * length + 4 / 3 * math.pi * 0.05**3, rel=0.06)
    np.testing.assert_allclose(mesh.centroid, np.add(start, end) / 2, atol=1e-3)


def test_the_surface_of_every_link_lies_on_its_body_dense_enough_to_be_coloured(panda_model: RobotModel) -> None:
    surfaces = capsule_surfaces(panda_model)
    assert set(surfaces) == set(panda_model.capsules.link.tolist())
    for link, mesh in surfaces.items():
        shape = panda_model.capsules.of_links(np.array([link]))
        apart = np.linalg.norm(from_axes(mesh.vertices, shape.a, shape.b)[1], axis=2) - shape.radius
        assert np.abs(apart).min(axis=1).max() < 1e-3
        assert mesh.volume > 0
        assert np.percentile(mesh.edges_unique_length, 90) < 1.5 * EDGE_M


def test_a_coloured_surface_is_read_by_another_program(panda_model: RobotModel) -> None:
    mesh = capsule_surfaces(panda_model)[5]
    colours = np.random.default_rng(0).uniform(0, 255, mesh.vertices.shape)
    data = coloured(mesh, colours)
    again = trimesh.load(io.BytesIO(data), file_type="glb", process=False).to_mesh()
    np.testing.assert_allclose(again.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(again.faces, mesh.faces)
    screen = colours / 255
    linear = np.where(screen <= 0.04045, screen / 12.92, ((screen + 0.055) / 1.055) ** 2.4)
    rgba = np.column_stack([np.rint(255 * linear), np.full(len(colours), 255)]).astype(np.uint8)
    assert rgba.tobytes() in data
