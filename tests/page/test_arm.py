"""The arm of the page: where it is, and where contact is expected on it."""

import io

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pretouch.page import palette
from pretouch.page.arm import (
    LEVELS,
    SETTLE_S,
    SPREAD_M,
    ArmBody,
    coloured,
    expectation,
    in_levels,
    on_surface,
    seen_from,
    shares,
)
from pretouch.page.surfaces import capsule_surfaces
from pretouch.params import ThresholdParams
from pretouch.types import Obstacles, no_obstacles

PERIOD = 1 / 30


@pytest.fixture
def arm(fake, panda_model, paper_skin):
    return ArmBody(fake, panda_model, paper_skin, capsule_surfaces(panda_model))


def test_units_colour_the_links_that_move_as_one_with_theirs(panda_model, paper_skin):
    def names(link: str) -> set[str]:
        return {paper_skin.ids[i] for i in seen_from(panda_model, paper_skin, panda_model.link_index(link))[0]}

    hand = {"hand_left", "hand_right", "hand_front", "hand_back"}
    assert names("panda_hand") == names("panda_link7") == hand
    assert names("panda_link5") == {"forearm_left", "forearm_right"}
    assert names("panda_link1") == set()


def test_units_are_seen_from_another_link_where_kinematics_puts_them(panda_model, paper_skin):
    link = panda_model.link_index("panda_link7")
    units, origin, beam = seen_from(panda_model, paper_skin, link)
    kin = panda_model.kinematics(np.array([0.3, -0.5, 0.2, -2.0, 0.4, 1.5, 0.9]))
    for unit, there, along in zip(units, origin, beam, strict=True):
        own, pose = paper_skin.link[unit], paper_skin.T_link_sensor[unit]
        point = kin.position[own] + kin.rotation[own] @ pose[:3, 3]
        np.testing.assert_allclose(kin.position[link] + kin.rotation[link] @ there, point, atol=1e-12)
        np.testing.assert_allclose(kin.rotation[link] @ along, kin.rotation[own] @ pose[:3, 2], atol=1e-12)


def test_an_unchanged_link_is_not_sent_again(fake, arm):
    for i in range(90):
        arm.paint((0, 0, 12, 0, 0, 0, 0), i * PERIOD)
    painted = [name.split("/")[2] for name, key, _ in fake.sent if key == "glb_data"]
    assert sorted(painted) == ["panda_hand", "panda_link7"]


def test_however_much_changes_the_traffic_is_bounded(fake, arm):
    seconds, random = 10.0, np.random.default_rng(0)
    for i in range(int(seconds / PERIOD)):
        arm.paint(tuple(random.integers(0, LEVELS + 1, 7).tolist()), i * PERIOD)
    assert 0 < fake.bytes_of("glb_data") / seconds < 600_000


def test_what_is_shown_was_sent_long_enough_before_and_one_surface_of_each_coloured_link_is_always_shown(fake, arm):
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


def test_the_links_are_drawn_where_they_are(fake, arm, panda_model):
    kin = panda_model.kinematics(panda_model.q_mid)
    arm.place(kin)
    hand = panda_model.link_index("panda_hand")
    np.testing.assert_array_equal(fake.nodes["/arm/panda_hand"].position, kin.position[hand])
    w, x, y, z = fake.nodes["/arm/panda_hand"].wxyz
    third = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(third, kin.rotation[hand][:, 2], atol=1e-12)


def test_a_coloured_surface_is_read_by_another_program(panda_model):
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


# where contact is expected

UP = np.array([[0.0, 0.0, 1.0]])


def obstacles(units: list[int], distances: list[float]) -> Obstacles:
    return no_obstacles(len(units))._replace(unit=np.array(units, np.int64), body_distance=np.array(distances))


@pytest.mark.parametrize(
    ("units", "distances", "expected"),
    [
        ([0, 1, 2, 3, 4], [0.05, 0.45, 0.85, 2.0, -0.01], [1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0]),
        ([1, 1], [0.65, 0.25], [0.0, 0.75, 0.0, 0.0, 0.0, 0.0, 0.0]),  # the nearest of two points counts
        ([1, 7, 12], [0.45, 0.05, 0.05], [0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]),  # two seen by outside sources
        ([], [], [0.0] * 7),
    ],
)
def test_contact_is_expected_fully_at_d_min_not_at_all_at_d_max_and_by_half_between(units, distances, expected):
    result = expectation(obstacles(units, distances), 7, ThresholdParams(d_min_m=0.05, d_max_m=0.85))
    np.testing.assert_allclose(result, expected, atol=1e-12)


def test_a_unit_colours_the_surface_under_it_fully_nothing_from_the_spread_on_nor_the_far_side_of_a_thin_link():
    vertices = np.array([[0.0, 0.0, 0.0], [SPREAD_M, 0.0, 0.0], [0.0, 3 * SPREAD_M, 0.0]])
    share = shares(vertices, np.repeat(UP, 3, axis=0), np.zeros((1, 3)), UP)
    np.testing.assert_allclose(share[:, 0], [1.0, 0.0, 0.0], atol=1e-12)
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    share = shares(np.zeros((3, 3)), normals, np.zeros((1, 3)), UP)
    np.testing.assert_allclose(share[:, 0], [1.0, 0.5, 0.0], atol=1e-12)


@given(st.lists(st.floats(0, 1), min_size=3, max_size=3), st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_what_units_expect_adds_up_within_one(share, expected):
    (total,) = on_surface(np.array([share]), np.array(expected))
    most = max(s * e for s, e in zip(share, expected, strict=True))
    assert most - 1e-12 <= total <= 1.0


def test_levels_are_even_steps_and_colours_go_from_the_arms_own_to_red():
    assert in_levels(np.array([0.0, 0.5, 1.0])) == (0, LEVELS // 2, LEVELS)
    assert len({in_levels(np.array([e])) for e in np.linspace(0, 1, 1000)}) == LEVELS + 1
    plain, half, full = palette.between(palette.EXPECTED, np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(plain, palette.ARM)
    assert full[0] > 190
    assert full[1:].max() < 50
    assert full[1] < half[1] < plain[1]
