import numpy as np
import pytest
import trimesh
from tests.needs import skip_without

from pretouch.extras import MESHES
from pretouch.robot.model import RobotModel
from pretouch.viewer import vendor
from pretouch.viewer.vendor import coarse, vendor_surfaces


def sphere(rings: int = 60) -> trimesh.Trimesh:
    """A sphere of radius 5 cm, each triangle with vertices of its own, as the vendor's files have them."""
    ball = trimesh.creation.uv_sphere(0.05, count=(rings, rings))
    corners = np.arange(3 * len(ball.faces)).reshape(-1, 3)
    return trimesh.Trimesh(ball.triangles.reshape(-1, 3), corners, process=False)


def test_a_coarse_mesh_has_few_vertices_near_the_fine_one_and_looks_outwards() -> None:
    fine = sphere()
    mesh = coarse(fine, 0.006)
    assert len(mesh.vertices) < len(fine.vertices) / 10
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 0.05).max() < 0.003
    assert np.einsum("vi,vi->v", mesh.vertex_normals, mesh.vertices).min() > 0
    assert set(np.unique(mesh.faces)) == set(range(len(mesh.vertices)))


def test_a_coarse_mesh_has_no_empty_or_double_triangle() -> None:
    mesh = coarse(sphere())
    corners = np.sort(mesh.faces, axis=1)
    assert (np.diff(corners, axis=1) > 0).all()
    assert len(np.unique(corners, axis=0)) == len(corners)


def test_without_the_extra_the_capsules_are_drawn_and_a_sentence_says_why(
    panda_model: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vendor, "_folder", lambda: None)
    found, said = vendor_surfaces(panda_model)
    assert found == {}
    assert said == f"The arm is drawn by its capsules; for the vendor's surfaces run {MESHES.command}"


def test_with_the_extra_every_link_has_a_surface_near_its_capsules(panda_model: RobotModel) -> None:
    skip_without(MESHES)
    found, said = vendor_surfaces(panda_model)
    assert said == ""
    for link in np.unique(panda_model.capsules.link):
        capsules, mesh = panda_model.capsules.of_links(np.array([link])), found[int(link)]
        low = (capsules.a - capsules.radius[:, None]).min(axis=0)
        assert (
            mesh.vertices.min(axis=0) > np.minimum(low, (capsules.b - capsules.radius[:, None]).min(axis=0)) - 0.06
        ).all()
