import numpy as np
import pytest
from tests.viewer.fake_scene import FakeScene

from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.viewer.arm import SETTLE_S, Arm, capsule_surfaces, seen_from
from pretouch.viewer.expectation import LEVELS

PERIOD = 1 / 30


@pytest.fixture
def scene() -> FakeScene:
    return FakeScene()


@pytest.fixture
def arm(scene: FakeScene, panda_model: RobotModel, paper_skin: Skin) -> Arm:
    return Arm(scene, panda_model, paper_skin, capsule_surfaces(panda_model))  # type: ignore[arg-type]


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


def test_a_link_without_a_unit_is_never_sent_again(scene: FakeScene, arm: Arm) -> None:
    for i in range(60):
        arm.paint((i % (LEVELS + 1),) * 7, i * PERIOD)
    coloured = {name.split("/")[2] for name, key, _ in scene.sent if key == "glb_data"}
    assert coloured == {"panda_link5", "panda_link6", "panda_link7", "panda_hand"}


def test_an_unchanged_link_is_not_sent_again(scene: FakeScene, arm: Arm) -> None:
    sent = [arm.paint((0, 0, 12, 0, 0, 0, 0), i * PERIOD) for i in range(90)]
    assert sum(size > 0 for size in sent) == 1
    assert {name.split("/")[2] for name, key, _ in scene.sent if key == "glb_data"} == {"panda_hand", "panda_link7"}


def test_however_much_changes_the_traffic_is_bounded(arm: Arm) -> None:
    seconds, random = 10.0, np.random.default_rng(0)
    sent = [
        arm.paint(tuple(random.integers(0, LEVELS + 1, 7).tolist()), i * PERIOD) for i in range(int(seconds / PERIOD))
    ]
    assert sum(sent) / seconds < 600_000


def test_what_is_shown_was_sent_long_enough_before(scene: FakeScene, arm: Arm) -> None:
    time_sent: dict[str, float] = {}
    shown_after = []
    for i in range(200):
        now, begun = i * PERIOD, len(scene.sent)
        arm.paint((i // 10 % LEVELS,) * 7, now)
        for name, key, _ in scene.sent[begun:]:
            if key == "visible" and scene.nodes[name].visible:
                shown_after.append(now - time_sent[name])
            if key == "glb_data":
                assert not scene.nodes[name].visible
                time_sent[name] = now
    assert len(shown_after) > 20
    assert min(shown_after) >= SETTLE_S - 1e-9


def test_one_of_the_two_coloured_surfaces_is_always_shown(scene: FakeScene, arm: Arm) -> None:
    for i in range(100):
        arm.paint((i % LEVELS,) * 7, i * PERIOD)
        for link in ("panda_link5", "panda_hand"):
            assert scene.nodes[f"/arm/{link}/front"].visible is not scene.nodes[f"/arm/{link}/back"].visible


def test_the_links_are_drawn_where_they_are(scene: FakeScene, arm: Arm, panda_model: RobotModel) -> None:
    kin = panda_model.kinematics(panda_model.q_mid)
    arm.place(kin)
    hand = panda_model.link_index("panda_hand")
    np.testing.assert_array_equal(scene.nodes["/arm/panda_hand"].position, kin.position[hand])
    w, x, y, z = scene.nodes["/arm/panda_hand"].wxyz
    third = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(third, kin.rotation[hand][:, 2], atol=1e-12)
