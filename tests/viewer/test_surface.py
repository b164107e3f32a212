import math
from collections import Counter

import numpy as np
import pytest
import trimesh

from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.viewer.arm import capsule_surfaces
from pretouch.viewer.surface import Mesh, signed_distance, surface_of


def capsule(a: tuple[float, float, float], b: tuple[float, float, float], radius: float) -> Capsules:
    return Capsules(np.zeros(1, np.int64), np.array([a]), np.array([b]), np.array([radius]))


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6)


def edges(mesh: Mesh) -> Counter[tuple[int, int]]:
    pairs = np.sort(np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    return Counter(map(tuple, pairs.tolist()))


def test_the_surface_of_a_capsule_is_closed_on_it_and_encloses_its_volume() -> None:
    shape = capsule((0.0, 0.0, -0.1), (0.02, 0.0, 0.1), 0.05)
    mesh = surface_of(shape)
    length = math.hypot(0.02, 0.2)
    assert np.abs(signed_distance(mesh.vertices, shape)).max() < 1e-6
    assert set(edges(mesh).values()) == {2}
    assert volume(mesh) == pytest.approx(math.pi * 0.05**2 * length + 4 / 3 * math.pi * 0.05**3, rel=0.02)


def test_the_surface_of_every_link_is_nearly_closed_and_turned_outwards(panda_model: RobotModel) -> None:
    surfaces = capsule_surfaces(panda_model)
    assert set(surfaces) == set(panda_model.capsules.link.tolist())
    for link, mesh in surfaces.items():
        shape = panda_model.capsules.of_links(np.array([link]))
        shared = np.array(list(edges(mesh).values()))
        assert np.mean(shared == 2) > 0.995
        assert volume(mesh) > 0
        assert signed_distance(mesh.vertices + 0.002 * mesh.normals, shape).min() > 0.001
        assert (
            np.einsum(
                "vi,vi->v", trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).vertex_normals, mesh.normals
            ).min()
            > 0.8
        )


def test_the_surface_is_never_far_from_the_body_the_controller_knows(panda_model: RobotModel) -> None:
    for link, mesh in capsule_surfaces(panda_model).items():
        shape = panda_model.capsules.of_links(np.array([link]))
        ends = zip(shape.a, shape.b, shape.radius, strict=True)
        apart = np.min([signed_distance(mesh.vertices, capsule(*one)) for one in ends], axis=0)
        assert apart.min() > -1e-6
        assert apart.max() < 0.012  # where three meet, the crease is filled twice


def test_vertices_are_dense_enough_to_be_coloured(panda_model: RobotModel) -> None:
    mesh = capsule_surfaces(panda_model)[panda_model.link_index("panda_hand")]
    sides = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    assert np.percentile(np.linalg.norm(sides, axis=2), 99) < 0.02
