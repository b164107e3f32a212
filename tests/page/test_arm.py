import io
import math

import numpy as np
import pytest
import trimesh
from tests.needs import skip_without
from tests.page.fake_scene import FakeScene

from pretouch.extras import MESHES
from pretouch.page import vendor
from pretouch.page.arm import SETTLE_S, Arm, capsule_surfaces, coloured, seen_from
from pretouch.page.expectation import EDGE_M, LEVELS, surface_of
from pretouch.page.vendor import coarse, vendor_surfaces
from pretouch.robot.body import Capsules, from_axes
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin

PERIOD = 1 / 30


@pytest.fixture
def arm(fake: FakeScene, panda_model: RobotModel, paper_skin: Skin) -> Arm:
    return Arm(fake, panda_model, paper_skin, capsule_surfaces(panda_model))  # type: ignore[arg-type]


def test_units_colour_the_links_that_move_as_one_with_theirs(panda_model: RobotModel, paper_skin: Skin) -> None:
    def names(link: str) -> set[str]:
        return {paper_skin.ids[i] for i in seen_from(panda_model, paper_skin, panda_model.link_index(link))[0]}

    hand = {"hand_left", "hand_right", "hand_front", "hand_back"}
    assert names("panda_hand") == names("panda_link7") == hand
    assert names("panda_link5") == {"forearm_left", "forearm_right"}
    assert names("panda_link1") == set()


def test_units_are_seen_from_another_link_where_kinematics_puts_them(panda_model: RobotModel, paper_skin: Skin) -> None:
    link = panda_model.link_index("panda_link7")
    units, origin, beam = seen_from(panda_model, paper_skin, link)
    kin = panda_model.kinematics(np.array([0.3, -0.5, 0.2, -2.0, 0.4, 1.5, 0.9]))
    for unit, there, along in zip(units, origin, beam, strict=True):
        own, pose = paper_skin.link[unit], paper_skin.T_link_sensor[unit]
        point = kin.position[own] + kin.rotation[own] @ pose[:3, 3]
        np.testing.assert_allclose(kin.position[link] + kin.rotation[link] @ there, point, atol=1e-12)
        np.testing.assert_allclose(kin.rotation[link] @ along, kin.rotation[own] @ pose[:3, 2], atol=1e-12)


def test_an_unchanged_link_is_not_sent_again(fake: FakeScene, arm: Arm) -> None:
    sent = [arm.paint((0, 0, 12, 0, 0, 0, 0), i * PERIOD) for i in range(90)]
    assert sum(size > 0 for size in sent) == 1
    assert {name.split("/")[2] for name, key, _ in fake.sent if key == "glb_data"} == {"panda_hand", "panda_link7"}


def test_however_much_changes_the_traffic_is_bounded(arm: Arm) -> None:
    seconds, random = 10.0, np.random.default_rng(0)
    sent = [
        arm.paint(tuple(random.integers(0, LEVELS + 1, 7).tolist()), i * PERIOD) for i in range(int(seconds / PERIOD))
    ]
    assert sum(sent) / seconds < 600_000


def test_what_is_shown_was_sent_long_enough_before_and_one_surface_of_each_coloured_link_is_always_shown(
    fake: FakeScene, arm: Arm
) -> None:
    time_sent: dict[str, float] = {}
    shown_after = []
    for i in range(200):
        now, begun = i * PERIOD, len(fake.sent)
        arm.paint((i // 10 % LEVELS,) * 7, now)
        for name, key, _ in fake.sent[begun:]:
            if key == "visible" and fake.nodes[name].visible:
                shown_after.append(now - time_sent[name])
            if key == "glb_data":
                assert not fake.nodes[name].visible
                time_sent[name] = now
        for link in ("panda_link5", "panda_hand"):
            assert fake.nodes[f"/arm/{link}/front"].visible is not fake.nodes[f"/arm/{link}/back"].visible
    assert {name.split("/")[2] for name in time_sent} == {"panda_link5", "panda_link6", "panda_link7", "panda_hand"}
    assert len(shown_after) > 20
    assert min(shown_after) >= SETTLE_S - 1e-9


def test_the_links_are_drawn_where_they_are(fake: FakeScene, arm: Arm, panda_model: RobotModel) -> None:
    kin = panda_model.kinematics(panda_model.q_mid)
    arm.place(kin)
    hand = panda_model.link_index("panda_hand")
    np.testing.assert_array_equal(fake.nodes["/arm/panda_hand"].position, kin.position[hand])
    w, x, y, z = fake.nodes["/arm/panda_hand"].wxyz
    third = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(third, kin.rotation[hand][:, 2], atol=1e-12)


# what the links are drawn by: surfaces of their capsules, or the vendor's


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


def sphere(rings: int = 60) -> trimesh.Trimesh:
    """A sphere of radius 5 cm, each triangle with vertices of its own, as the vendor's files have them."""
    ball = trimesh.creation.uv_sphere(0.05, count=(rings, rings))
    corners = np.arange(3 * len(ball.faces)).reshape(-1, 3)
    return trimesh.Trimesh(ball.triangles.reshape(-1, 3), corners, process=False)


def test_a_coarse_mesh_has_few_vertices_near_the_fine_one_looks_outwards_and_has_no_empty_or_double_triangle() -> None:
    fine = sphere()
    mesh = coarse(fine, 0.006)
    assert len(mesh.vertices) < len(fine.vertices) / 10
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 0.05).max() < 0.003
    assert np.einsum("vi,vi->v", mesh.vertex_normals, mesh.vertices).min() > 0
    assert set(np.unique(mesh.faces)) == set(range(len(mesh.vertices)))
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
