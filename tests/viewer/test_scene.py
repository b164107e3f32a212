from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.viewer.fake_scene import FakeScene

from pretouch.profiles import PROFILES
from pretouch.types import NOT_TOUCHED, ControlStep, Obstacles, Touched
from pretouch.viewer import palette
from pretouch.viewer.frame import Frame, World
from pretouch.viewer.scene import ARROW_MOST_M, PARTS, Scene
from pretouch.viewer.simulation import LiveSimulation


@pytest.fixture(scope="module")
def world():  # type: ignore[no-untyped-def]
    return LiveSimulation().world


@pytest.fixture
def nodes() -> FakeScene:
    return FakeScene()


@pytest.fixture
def scene(world, nodes: FakeScene) -> Scene:  # type: ignore[no-untyped-def]
    return Scene(SimpleNamespace(scene=nodes, initial_camera=SimpleNamespace()), world)  # type: ignore[arg-type]


def seen_by(unit: int, point: tuple[float, float, float], step: ControlStep) -> ControlStep:
    """A step in which one unit senses one point, 0.2 m off the body."""
    distance = np.full(7, np.nan)
    distance[unit] = 0.2
    at = np.array([point])
    obstacles = Obstacles(
        np.array([unit]), at, np.array([0.2]), at - [0.2, 0.0, 0.0], np.array([10]), np.array([[1.0, 0.0, 0.0]]),
        np.array([0.2]), np.zeros(1),
    )  # fmt: skip
    return replace(step, obstacles=obstacles, range_distance=distance)


def frame(step: ControlStep, **more: object) -> Frame:
    return Frame(**{"step": step, "hand": None, "hand_target": None, "true_force": None, **more})  # type: ignore[arg-type]


def test_a_sensed_point_is_a_sphere_where_it_is_and_others_are_not_to_be_seen(
    scene: Scene, nodes: FakeScene, some_step: ControlStep
) -> None:
    scene.draw(frame(seen_by(2, (0.7, 0.1, 0.3), some_step)), 0.0)
    points = nodes.nodes["/points"]
    np.testing.assert_allclose(points.batched_positions[2], (0.7, 0.1, 0.3), atol=1e-6)
    assert (points.batched_scales > 1e-3).tolist() == [False, False, True, False, False, False, False]


def test_the_cone_of_a_unit_that_senses_reaches_as_far(scene: Scene, nodes: FakeScene, some_step: ControlStep) -> None:
    scene.draw(frame(seen_by(2, (0.7, 0.1, 0.3), some_step)), 0.0)
    cones = nodes.nodes["/arm/panda_hand/cones"]
    assert cones.batched_scales[2] == pytest.approx(0.2)
    assert cones.batched_opacities[2] > cones.batched_opacities[0]


def test_a_unit_silent_for_longer_than_the_profile_allows_is_red_and_its_cone_too(
    scene: Scene, nodes: FakeScene, world: World, some_step: ControlStep
) -> None:
    limit = world.profile.sight.silent_after_s
    age = np.array([0.0, limit + 0.01, limit - 0.01, 0.0, 0.0, 0.0, 0.0])
    scene.draw(frame(replace(some_step, range_distance=np.full(7, 0.5)), age=age), 0.0)
    red = palette.as_vertex(palette.UNIT_SILENT)
    for part in ("units", "cones"):
        colours = nodes.nodes[f"/arm/panda_hand/{part}"].batched_colors
        assert [np.array_equal(colour, red) for colour in colours] == [False, True, False, False]
    assert nodes.nodes["/arm/panda_hand/cones"].batched_scales[1] < 0.2  # what it read last says nothing


def test_without_known_ages_no_unit_is_red(scene: Scene, nodes: FakeScene, some_step: ControlStep) -> None:
    scene.draw(frame(some_step), 0.0)
    colours = nodes.nodes["/arm/panda_hand/units"].batched_colors
    assert not np.any(np.all(colours == palette.as_vertex(palette.UNIT_SILENT), axis=1))


def without_obstacles(step: ControlStep, unit: int, distance: float) -> ControlStep:
    """A step in which a unit reads a distance, and no obstacle is made of it."""
    one = seen_by(unit, (0.0, 0.0, 0.0), step).obstacles
    none = Obstacles(*(getattr(one, part.name)[:0] for part in fields(one)))
    return replace(step, range_distance=np.where(np.arange(7) == unit, distance, np.nan), obstacles=none)


def test_a_reading_that_no_obstacle_is_made_of_is_a_point_only_where_perception_is_off(
    scene: Scene, nodes: FakeScene, world: World, some_step: ControlStep
) -> None:
    step = without_obstacles(some_step, 2, 0.03)
    points, cones = nodes.nodes["/points"], nodes.nodes["/arm/panda_hand/cones"]
    scene.draw(frame(step), 0.0)
    assert np.all(points.batched_scales < 1e-3)  # the arm itself, which the filter left out
    idle = cones.batched_scales[0]
    assert cones.batched_scales[2] == idle > 0.04

    scene.show_world(replace(world, profile=PROFILES["blind"]))
    scene.draw(frame(step), 0.1)
    assert np.flatnonzero(points.batched_scales > 1e-3).tolist() == [2]
    kin, pose = world.model.kinematics(step.q), world.skin.T_link_sensor[2]
    link = world.skin.link[2]
    expected = kin.position[link] + kin.rotation[link] @ (pose[:3, :3] @ (0.0, 0.0, 0.03) + pose[:3, 3])
    np.testing.assert_allclose(points.batched_positions[2], expected, atol=1e-6)
    assert cones.batched_scales[2] == pytest.approx(0.03)

    scene.draw(frame(step, age=np.full(7, 1.0)), 0.2)
    assert np.all(points.batched_scales < 1e-3)


@pytest.mark.parametrize(("multiplier", "colour"), [(0.0, palette.PAIR), (0.5, palette.LIMITING)])
def test_each_point_is_joined_to_the_body_and_the_line_says_whether_it_binds(
    scene: Scene, nodes: FakeScene, some_step: ControlStep, multiplier: float, colour: palette.Colour
) -> None:
    step = seen_by(2, (0.7, 0.1, 0.3), replace(some_step, restricted=np.array([0])))
    multipliers = np.append(np.zeros(len(step.q)), multiplier)
    step = replace(step, qp=replace(step.qp, slack=np.zeros(1), multipliers=multipliers))
    scene.draw(frame(step), 0.0)
    pairs = nodes.nodes["/pairs"]
    assert pairs.visible
    np.testing.assert_allclose(pairs.points, [[(0.5, 0.1, 0.3), (0.7, 0.1, 0.3)]], atol=1e-6)
    np.testing.assert_array_equal(pairs.colors, np.tile(palette.as_vertex(colour), (1, 2, 1)))


@pytest.mark.parametrize("size", [7.0, 20.0, 5000.0])
def test_a_force_is_an_arrow_of_bounded_length_at_the_end_effector(
    scene: Scene, nodes: FakeScene, some_step: ControlStep, size: float
) -> None:
    force = np.array([0.0, 0.6 * size, -0.8 * size])
    scene.draw(frame(replace(some_step, force=force), true_force=force), 0.0)
    for name in ("/ee/force", "/touched/true_force"):
        start, end = nodes.nodes[name].points[0]
        assert nodes.nodes[name].visible
        assert not start.any()
        np.testing.assert_allclose(end / np.linalg.norm(end), force / size, atol=1e-6)
        assert np.linalg.norm(end) <= ARROW_MOST_M + 1e-6
    for name in ("/ee", "/touched"):
        np.testing.assert_allclose(nodes.nodes[name].position, some_step.ee_position, atol=1e-9)


def test_the_true_force_is_drawn_where_it_acts_if_that_is_known(
    scene: Scene, nodes: FakeScene, some_step: ControlStep
) -> None:
    elbow = np.array([0.1, 0.2, 0.6])
    scene.draw(frame(some_step, true_force=np.array([0.0, 0.0, 20.0]), true_point=elbow), 0.0)
    np.testing.assert_array_equal(nodes.nodes["/touched"].position, elbow)
    np.testing.assert_allclose(nodes.nodes["/ee"].position, some_step.ee_position, atol=1e-9)


def test_a_touched_place_is_an_arrow_that_ends_there(
    scene: Scene, nodes: FakeScene, some_step: ControlStep
) -> None:  # fmt: skip
    at, force = np.array([[0.3, 0.1, 0.6]]), np.array([[0.0, 0.0, -20.0]])
    touched = Touched(np.array([5]), at, force, np.array([0.02]), np.array([0.9]))
    scene.draw(frame(replace(some_step, touched=touched)), 0.0)
    (begin, end) = nodes.nodes["/place"].points[0]
    np.testing.assert_allclose(end, at[0], atol=1e-6)
    np.testing.assert_allclose(end - begin, [0.0, 0.0, -0.24], atol=1e-6)
    scene.draw(frame(replace(some_step, touched=NOT_TOUCHED)), 0.0)
    assert not nodes.nodes["/place"].visible


@pytest.mark.parametrize("force", [np.zeros(3), np.array([0.0, 5.0, 0.0]), np.full(3, np.nan), None])
def test_without_a_force_above_the_noise_there_is_no_arrow(
    scene: Scene, nodes: FakeScene, some_step: ControlStep, force: np.ndarray | None
) -> None:
    step = some_step if force is None else replace(some_step, force=force)
    scene.draw(frame(step, true_force=force), 0.0)
    assert not nodes.nodes["/touched/true_force"].visible
    if force is not None:
        assert not nodes.nodes["/ee/force"].visible


def test_the_hand_is_drawn_where_it_is_and_its_target_when_that_is_elsewhere(
    scene: Scene, nodes: FakeScene, some_step: ControlStep
) -> None:
    hand = np.array([0.8, 0.1, 0.4])
    scene.draw(frame(some_step, hand=hand, hand_target=hand + 0.001), 0.0)
    np.testing.assert_array_equal(nodes.nodes["/hand"].position, hand)
    assert not nodes.nodes["/hand_target"].visible
    scene.draw(frame(some_step, hand=hand, hand_target=hand + 0.2), 0.1)
    assert nodes.nodes["/hand_target"].visible
    np.testing.assert_array_equal(nodes.nodes["/hand_target"].position, hand + 0.2)
    scene.draw(frame(some_step), 0.2)
    assert not nodes.nodes["/hand"].visible
    assert not nodes.nodes["/hand_target"].visible


def test_every_part_can_be_hidden_and_shown(scene: Scene, nodes: FakeScene, some_step: ControlStep) -> None:
    def shown() -> set[str]:
        return {name for name, node in nodes.nodes.items() if node.visible and not name.endswith(("/front", "/back"))}

    step = replace(some_step, force=np.array([20.0, 0.0, 0.0]), restricted=np.array([0]))
    step = seen_by(2, (0.7, 0.1, 0.3), step)
    pushed = np.append(np.zeros(len(step.q)), 0.5)
    step = replace(step, qp=replace(step.qp, slack=np.zeros(1), multipliers=pushed))
    for x in (0.0, 0.1, 0.2):
        scene.trail.add(replace(step, ee_position=step.ee_position + np.array([x, 0.0, 0.0])))
    scene.draw(frame(step), 0.0)
    before = shown()
    for i, part in enumerate(PARTS):
        scene.show(part, False)
        scene.draw(frame(step), 2.0 * i + 1.0)
        assert shown() < before, part
        scene.show(part, True)
        scene.draw(frame(step), 2.0 * i + 2.0)
        assert shown() == before, part


def test_another_world_has_its_own_boxes_and_path(scene: Scene, nodes: FakeScene) -> None:
    simulation = LiveSimulation()
    simulation.reset(object="board -y", path="line")
    scene.show_world(simulation.world)
    assert sum(name.startswith("/box/") for name in nodes.nodes) == 1
    ends = nodes.nodes["/path"].points
    assert np.ptp(ends[..., 0]) < 1e-6  # the paper's line is at x = 0.4 m
    scene.show_world(LiveSimulation().world)
    assert not any(name.startswith("/box/") for name in nodes.nodes)


def test_a_unit_that_sees_glows_and_more_so_where_its_obstacle_holds_the_arm_back(
    scene: Scene, nodes: FakeScene, some_step: ControlStep
) -> None:
    step = seen_by(2, (0.7, 0.1, 0.3), some_step)
    plates = nodes.nodes["/arm/panda_hand/units"]
    scene.draw(frame(step), 0.0)
    colours = [palette.as_vertex(c).tolist() for c in (palette.UNIT, palette.SEEING, palette.LIMITING)]
    assert [plates.batched_colors[unit].tolist() for unit in (0, 2)] == [colours[0], colours[1]]
    pushed = np.append(np.zeros(len(step.q)), 0.5)
    qp = replace(step.qp, slack=np.zeros(1), multipliers=pushed)
    scene.draw(frame(replace(step, restricted=np.array([0]), qp=qp)), 0.1)
    assert [plates.batched_colors[unit].tolist() for unit in (0, 2)] == [colours[0], colours[2]]


def test_other_parameters_of_the_same_world_send_nothing(scene: Scene, nodes: FakeScene) -> None:
    simulation = LiveSimulation()
    simulation.reset(object="board -y")
    scene.show_world(simulation.world)
    nodes.sent.clear()
    box = nodes.nodes["/box/0"]
    simulation.set_profile(PROFILES["blind"])
    scene.show_world(simulation.world)
    assert nodes.sent == []
    assert nodes.nodes["/box/0"] is box
