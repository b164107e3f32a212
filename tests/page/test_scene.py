from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.page.fake_scene import Node

from pretouch.page import palette
from pretouch.page.frame import Frame
from pretouch.page.scene import ARROW_MOST_M, PARTS, Scene
from pretouch.page.simulation import LiveSimulation
from pretouch.page.trail import BLOCK, BLOCKS, SPACING_M, Activity, Trail, activity
from pretouch.perception.local_map import map_init
from pretouch.profiles import PROFILES
from pretouch.types import NOT_TOUCHED, ControlStep, Mode, Touched, no_obstacles

POINT = np.array([0.7, 0.1, 0.3])
CONES, UNITS = "/arm/panda_hand/cones", "/arm/panda_hand/units"
Drawn = Callable[..., dict[str, Node]]


@pytest.fixture(scope="module")
def world():
    return LiveSimulation().world


@pytest.fixture
def scene(world, fake):
    return Scene(SimpleNamespace(scene=fake, initial_camera=SimpleNamespace()), world)


@pytest.fixture
def drawn(scene, fake):
    """Draw a step, with more that a frame has, at a time [s], and return what there is by name."""

    def draw(step: ControlStep, now: float = 0.0, **more: object) -> dict[str, Node]:
        parts = {"hand": None, "hand_target": None, "true_force": None, **more}
        scene.draw(Frame(step, **parts), now)
        return fake.nodes

    return draw


def sensing(step: ControlStep, multiplier: float = 0.0) -> ControlStep:
    """A step in which unit 2 senses a point, 0.2 m off the body, whose restriction has a multiplier."""
    at, direction = POINT[None], np.array([[1.0, 0.0, 0.0]])
    away, body_point = np.array([0.2]), at - 0.2 * direction
    obstacles = no_obstacles(1)._replace(
        unit=np.array([2]), point=at, ee_distance=away, body_point=body_point, link=np.array([10]),
        direction=direction, body_distance=away,
    )  # fmt: skip
    qp = replace(step.qp, slack=np.zeros(1), multipliers=np.append(np.zeros(len(step.q)), multiplier))
    distance = np.where(np.arange(7) == 2, 0.2, np.nan)
    return replace(step, obstacles=obstacles, range_distance=distance, restricted=np.array([0]), qp=qp)


def test_a_sensed_point_is_drawn_where_it_is_and_the_cone_reaches_as_far(drawn, some_step):
    nodes = drawn(sensing(some_step))
    np.testing.assert_allclose(nodes["/points"].points, [POINT], atol=1e-3)
    assert nodes[CONES].batched_scales[2] == pytest.approx(0.2)
    assert nodes[CONES].batched_opacities[2] > nodes[CONES].batched_opacities[0]


def test_a_unit_silent_for_longer_than_the_profile_allows_is_red_and_its_cone_too(drawn, world, some_step):
    limit, red = world.profile.sight.silent_after_s, palette.as_vertex(palette.UNIT_SILENT)
    age = np.array([0.0, limit + 0.01, limit - 0.01, 0.0, 0.0, 0.0, 0.0])
    nodes = drawn(replace(some_step, range_distance=np.full(7, 0.5)), age=age)
    for part in (UNITS, CONES):
        assert [np.array_equal(colour, red) for colour in nodes[part].batched_colors] == [False, True, False, False]
    assert nodes[CONES].batched_scales[1] < 0.1  # what it read last says nothing
    nodes = drawn(some_step, 0.1)  # ages are not known
    assert not np.any(np.all(nodes[UNITS].batched_colors == red, axis=1))


def test_a_reading_that_no_obstacle_is_made_of_is_no_point_and_without_perception_there_are_no_cones(
    scene, drawn, world, some_step
):
    distance = np.where(np.arange(7) == 2, 0.03, np.nan)
    step = replace(some_step, range_distance=distance, obstacles=no_obstacles())
    nodes = drawn(step)
    points, cones = nodes["/points"], nodes[CONES]
    assert len(points.points) == 0  # the arm itself, which the filter left out
    assert cones.batched_scales[2] == cones.batched_scales[0] > 0.04

    scene.show_world(replace(world, profile=PROFILES["blind"]))
    drawn(step, 0.1)
    assert len(points.points) == 0
    assert not cones.visible


def test_remembered_places_fade_and_the_units_glow_that_see_them_now(drawn, some_step):
    places = map_init(4)
    places.number[0], places.place[0], places.place[1] = 3, POINT, -POINT
    places.unit[:3], places.stamp[:3] = (2, 0, -1), some_step.stamp - np.array([0.0, 3.0, 12.0])
    nodes = drawn(replace(some_step, range_distance=np.full(7, 0.3)), places=places)
    np.testing.assert_allclose(nodes["/points"].points, [POINT, -POINT, np.zeros(3)], atol=1e-3)
    now, before, long_ago = nodes["/points"].colors.astype(float)
    np.testing.assert_array_equal([now, long_ago], palette.REMEMBERED)
    np.testing.assert_allclose(before, 0.75 * now + 0.25 * long_ago, atol=0.5)
    drawn(some_step, 0.1, places=places._replace(stamp=np.full(4, some_step.stamp), unit=np.full(4, -1)))
    assert not np.any(nodes[UNITS].batched_colors == palette.as_vertex(palette.SEEING))
    nodes = drawn(replace(some_step, range_distance=np.full(7, 0.3)), 0.2, places=places)
    assert np.flatnonzero(nodes[CONES].batched_scales > 0.1).tolist() == [2]
    glows = np.all(nodes[UNITS].batched_colors == palette.as_vertex(palette.SEEING), axis=1)
    assert np.flatnonzero(glows).tolist() == [2]


@pytest.mark.parametrize(
    ("multiplier", "line", "glow"), [(0.0, palette.PAIR, palette.SEEING), (0.5, palette.LIMITING, palette.LIMITING)]
)
def test_each_point_is_joined_to_the_body_and_line_and_unit_say_whether_it_holds_the_arm_back(
    drawn, some_step, multiplier, line, glow
):
    nodes = drawn(sensing(some_step, multiplier))
    pairs, plates = nodes["/pairs"], nodes[UNITS].batched_colors
    assert pairs.visible
    np.testing.assert_allclose(pairs.points, [[(0.5, 0.1, 0.3), POINT]], atol=1e-6)
    np.testing.assert_array_equal(pairs.colors, np.tile(palette.as_vertex(line), (1, 2, 1)))
    np.testing.assert_array_equal(plates[[0, 2]], [palette.as_vertex(palette.UNIT), palette.as_vertex(glow)])


@pytest.mark.parametrize("size", [7.0, 20.0, 5000.0])
def test_a_force_is_an_arrow_of_bounded_length_at_the_end_effector_or_where_the_true_one_acts(drawn, some_step, size):
    force = np.array([0.0, 0.6 * size, -0.8 * size])
    nodes = drawn(replace(some_step, force=force), true_force=force)
    for name in ("/ee/force", "/touched/true_force"):
        start, end = nodes[name].points[0]
        assert nodes[name].visible
        assert not start.any()
        np.testing.assert_allclose(end / np.linalg.norm(end), force / size, atol=1e-6)
        assert np.linalg.norm(end) <= ARROW_MOST_M + 1e-6
    for name in ("/ee", "/touched"):
        np.testing.assert_allclose(nodes[name].position, some_step.ee_position, atol=1e-9)
    elbow = np.array([0.1, 0.2, 0.6])
    nodes = drawn(some_step, true_force=force, true_point=elbow)
    np.testing.assert_array_equal(nodes["/touched"].position, elbow)


def test_a_touched_place_is_an_arrow_that_ends_there(drawn, some_step):
    at, force = np.array([[0.3, 0.1, 0.6]]), np.array([[0.0, 0.0, -20.0]])
    touched = Touched(np.array([5]), at, force, np.array([0.02]), np.array([0.9]))
    nodes = drawn(replace(some_step, touched=touched))
    (begin, end) = nodes["/place"].points[0]
    np.testing.assert_allclose(end, at[0], atol=1e-6)
    np.testing.assert_allclose(end - begin, [0.0, 0.0, -0.24], atol=1e-6)
    drawn(replace(some_step, touched=NOT_TOUCHED))
    assert not nodes["/place"].visible


@pytest.mark.parametrize("force", [np.zeros(3), np.array([0.0, 5.0, 0.0]), np.full(3, np.nan), None])
def test_without_a_force_above_the_noise_there_is_no_arrow(drawn, some_step, force):
    nodes = drawn(some_step if force is None else replace(some_step, force=force), true_force=force)
    assert not nodes["/touched/true_force"].visible
    if force is not None:
        assert not nodes["/ee/force"].visible


def test_the_hand_is_drawn_where_it_is_and_its_target_when_that_is_elsewhere(drawn, some_step):
    hand = np.array([0.8, 0.1, 0.4])
    nodes = drawn(some_step, hand=hand, hand_target=hand + 0.001)
    np.testing.assert_array_equal(nodes["/hand"].position, hand)
    assert not nodes["/hand_target"].visible
    drawn(some_step, 0.1, hand=hand, hand_target=hand + 0.2)
    assert nodes["/hand_target"].visible
    np.testing.assert_array_equal(nodes["/hand_target"].position, hand + 0.2)
    drawn(some_step, 0.2)
    assert not nodes["/hand"].visible
    assert not nodes["/hand_target"].visible


def test_every_part_can_be_hidden_and_shown(scene, drawn, some_step):
    step = replace(sensing(some_step, 0.5), force=np.array([20.0, 0.0, 0.0]))

    def shown(now: float) -> set[str]:
        nodes = drawn(step, now)
        return {name for name, node in nodes.items() if node.visible and not name.endswith(("/front", "/back"))}

    for x in (0.0, 0.1, 0.2):
        scene.trail.add(replace(step, ee_position=step.ee_position + np.array([x, 0.0, 0.0])))
    before = shown(0.0)
    for i, part in enumerate(PARTS):
        scene.show(part, False)
        assert shown(2.0 * i + 1.0) < before, part
        scene.show(part, True)
        assert shown(2.0 * i + 2.0) == before, part


def test_another_world_has_its_own_boxes_and_path_and_what_stays_is_not_sent_again(scene, fake):
    simulation = LiveSimulation()
    simulation.reset(object="board -y", path="line")
    scene.show_world(simulation.world)
    box, ends = fake.nodes["/box/0"], fake.nodes["/path"].points
    assert sum(name.startswith("/box/") for name in fake.nodes) == 1
    assert np.ptp(ends[..., 0]) < 1e-6  # the paper's line is at x = 0.4 m
    fake.sent.clear()
    simulation.set_profile(PROFILES["blind"])
    scene.show_world(simulation.world)
    assert fake.sent == []
    assert fake.nodes["/box/0"] is box
    scene.show_world(LiveSimulation().world)
    assert not any(name.startswith("/box/") for name in fake.nodes)


# the way the end-effector went


@pytest.fixture
def trail(fake):
    return Trail(fake)


def at(step: ControlStep, x: float) -> ControlStep:
    return replace(step, ee_position=np.array([x, 0.0, 0.0]), path_position=np.array([x, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("mode", "multiplier", "slack", "expected"),
    [
        (Mode.TRACK, 0.3, 0.0, Activity.AVOIDING),
        (Mode.TRACK, 0.0, 0.01, Activity.AVOIDING),
        (Mode.TRACK, 0.0, 0.0, Activity.RECOVERING),
        (Mode.REACT, 0.3, 0.0, Activity.REACTING),
        (Mode.HOLD, 0.3, 0.0, Activity.HOLDING),
    ],
)
def test_off_the_path_an_arm_avoids_while_an_obstacle_holds_it_or_its_row_is_violated_and_else_recovers(
    some_step, mode, multiplier, slack, expected
):
    assert activity(replace(some_step, mode=Mode.TRACK)) is Activity.FOLLOWING
    multipliers = np.append(np.zeros(len(some_step.q)), multiplier)
    qp = replace(some_step.qp, slack=np.array([slack]), multipliers=multipliers)
    beside = some_step.ee_position + np.array([0.0, 0.05, 0.0])
    assert activity(replace(some_step, mode=mode, path_position=beside, restricted=np.array([0]), qp=qp)) is expected


def test_a_trail_is_of_bounded_length(some_step, fake, trail):
    for i in range(5000):
        trail.add(at(some_step, i * SPACING_M * 1.01))
        trail.draw(i / 100)
    assert len(fake.nodes) == BLOCKS
    assert BLOCK * (BLOCKS - 1) <= len(trail) <= BLOCK * BLOCKS
    furthest = max(node.points[:, 1, 0].max() for node in fake.nodes.values())
    nearest = min(node.points[:, 0, 0].min() for node in fake.nodes.values())
    np.testing.assert_allclose(furthest, 4999 * SPACING_M * 1.01, rtol=1e-6)
    assert furthest - nearest < BLOCK * BLOCKS * SPACING_M * 1.02


def test_a_trail_sends_only_its_newest_block_and_little(some_step, fake, trail):
    for i in range(3000):
        trail.add(at(some_step, 0.003 * i))  # 0.3 m/s
        trail.draw(i / 100)
    assert fake.bytes_of("points", "colors") / 30.0 < 25_000
    points = [size for _, key, size in fake.sent if key == "points"]
    assert max(points) <= BLOCK * 2 * 3 * 4


def test_a_standing_arm_adds_nothing(some_step, fake, trail):
    for i in range(1000):
        trail.add(at(some_step, 0.002 * (i % 2)))
        trail.draw(i / 100)
    assert len(trail) == 0
    assert fake.sent == []


def test_the_segments_of_a_trail_join_until_it_is_cleared_and_begins_anew(some_step, fake, trail):
    for i in range(300):
        trail.add(at(some_step, 0.006 * i))
        trail.draw(i / 10)
    trail.draw(1000.0)
    points = np.concatenate([node.points for node in fake.nodes.values() if node.visible])
    np.testing.assert_array_equal(points[1:, 0], points[:-1, 1])
    assert len(points) == 299
    trail.clear()
    assert not any(node.visible for node in fake.nodes.values())
    trail.add(at(some_step, 5.0))
    trail.add(at(some_step, 5.1))
    trail.draw(2000.0)
    assert len(trail) == 1


def test_a_hidden_trail_stays_hidden_as_it_grows(some_step, fake, trail):
    for i in range(200):
        trail.add(at(some_step, 0.006 * i))
        trail.draw(i / 10)
        if i == 50:
            trail.show(False)
    assert not any(node.visible for node in fake.nodes.values())
    trail.show(True)
    assert sum(node.visible for node in fake.nodes.values()) == 5
