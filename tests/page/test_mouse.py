"""The hand of a live session: where it may begin, and where a pointer may lead it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.errors import ParameterError
from pretouch.page.mouse import GAP_M, HAND_FORCE_N, Mouse, at_depth, clear_place
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import Box, HandSpec, SceneSpec

HAND = HandSpec()
ROOM = HAND.radius + GAP_M
BOARD = Box("object", (0.6, -0.27, 0.3), (0.15, 0.02, 0.12), 25_000.0)
SCENE = SceneSpec(boxes=(BOARD,), hand=HAND)

fractions = arrays(np.float64, 7, elements=st.floats(0.0, 1.0))
places = st.tuples(st.floats(-1.0, 1.4), st.floats(-1.2, 1.2), st.floats(-0.2, 1.4)).map(np.array)


def gap_to_arm(model: RobotModel, q: np.ndarray, place: np.ndarray) -> float:
    """Distance [m] of a place from the arm's capsules, by sampling their axes."""
    kin, body, found = model.kinematics(q), model.capsules, np.inf
    along = np.linspace(0.0, 1.0, 400)[:, None]
    for link, a, b, radius in zip(body.link, body.a, body.b, body.radius, strict=True):
        axis = (a + along * (b - a)) @ kin.rotation[link].T + kin.position[link]
        found = min(found, np.linalg.norm(axis - place, axis=1).min() - radius)
    return float(found)


def gap_to_board(place: np.ndarray) -> float:
    low, high = np.array(BOARD.center) - BOARD.half_size, np.array(BOARD.center) + BOARD.half_size
    return float(np.linalg.norm(place - np.clip(place, low, high)))


@given(fractions, places)
def test_a_hand_is_never_begun_inside_the_arm_or_what_stands_around_it(panda_model, fraction, place):
    q = panda_model.q_min + fraction * (panda_model.q_max - panda_model.q_min)
    found = clear_place(panda_model, q, SCENE, place, ROOM)
    assert gap_to_arm(panda_model, q, found) >= ROOM - 1e-3  # the axes are sampled a millimetre apart
    assert gap_to_board(found) >= ROOM - 1e-9
    assert found[2] >= SCENE.floor_height + ROOM - 1e-9
    column = found - [0.0, 0.0, np.clip(found[2], SCENE.floor_height, -SCENE.pedestal_radius)]
    assert np.linalg.norm(column) >= SCENE.pedestal_radius + ROOM - 1e-9


@given(fractions, st.integers(0, 30), st.floats(0.0, 1.0))
@settings(max_examples=50)
def test_even_from_the_middle_of_a_link_it_is_moved_no_farther_than_it_has_to(panda_model, fraction, which, along):
    q = panda_model.q_min + fraction * (panda_model.q_max - panda_model.q_min)
    kin, body = panda_model.kinematics(q), panda_model.capsules
    c = which % len(body.radius)
    place = kin.position[body.link[c]] + kin.rotation[body.link[c]] @ (body.a[c] + along * (body.b[c] - body.a[c]))
    found = clear_place(panda_model, q, SceneSpec(hand=HAND), place, ROOM)
    assert gap_to_arm(panda_model, q, found) >= ROOM - 1e-3
    assert np.linalg.norm(found - place) < 0.75  # a folded arm is about as thick


@given(places)
@settings(max_examples=30)
def test_a_clear_place_stays(panda_model, place):
    q = panda_model.description.q_ready
    once = clear_place(panda_model, q, SCENE, place, ROOM)
    np.testing.assert_array_equal(clear_place(panda_model, q, SCENE, once, ROOM), once)


@given(fractions, places)
@settings(max_examples=25)
def test_the_physics_agrees_that_nothing_touches(panda_model, fraction, place):
    q = panda_model.q_min + fraction * (panda_model.q_max - panda_model.q_min)
    found = clear_place(panda_model, q, SCENE, place, ROOM)
    plant = Plant(panda_model, SceneSpec(hand=HandSpec(start=tuple(found))), PlantParams(), q, 0)
    names = {plant.mj_model.geom(g).name for c in plant.mj_data.contact[: plant.mj_data.ncon] for g in c.geom}
    assert "hand" not in names


@given(arrays(np.float64, 3, elements=st.floats(-1e6, 1e6)))
def test_a_target_anywhere_is_clipped_to_the_workspace_above_the_floor(target):
    mouse = Mouse(np.zeros(3), SCENE, HAND)
    mouse.move(target)
    low, high = [-1.0, -1.2, -0.2 + HAND.radius], [1.4, 1.2, 1.4]
    np.testing.assert_array_equal(mouse.target, np.clip(target, low, high))
    goal = mouse.goal(0.0, np.zeros(3), None)
    np.testing.assert_array_equal(goal.position, mouse.target)
    assert goal.force_max == HAND_FORCE_N


@pytest.mark.parametrize("target", [[0.5, np.nan, 0.3], [np.inf, 0.0, 0.3], [0.5, 0.3], [[0.5, 0.3, 0.1]]])
def test_what_is_no_place_is_refused_and_the_target_stays(target):
    mouse = Mouse(np.array([0.5, 0.3, 0.2]), SCENE, HAND)
    with pytest.raises(ParameterError, match=r"The hand's target is .*: give x, y and z in metres"):
        mouse.move(np.array(target))
    np.testing.assert_array_equal(mouse.target, [0.5, 0.3, 0.2])


EYE = np.array([1.75, 0.95, 0.85])


def test_a_place_pointed_to_on_the_arm_is_at_the_arms_depth(panda_model: RobotModel) -> None:
    q = panda_model.description.q_ready
    palm = panda_model.kinematics(q).position[panda_model.link_index("panda_hand")]
    before = EYE + 0.8 * (palm - EYE)  # nearer, in the same place of the picture
    place = at_depth(panda_model, q, EYE, before)
    assert np.linalg.norm(before - palm) > 0.3
    assert np.linalg.norm(place - palm) < 0.08
    assert np.linalg.norm(np.cross(place - EYE, palm - EYE)) < 1e-9


def test_a_place_pointed_to_far_from_the_arm_stays_and_in_between_nothing_jumps(panda_model: RobotModel) -> None:
    q = panda_model.description.q_ready
    far = np.array([0.6, 1.1, 0.4])
    np.testing.assert_allclose(at_depth(panda_model, q, EYE, far), far, atol=1e-3)
    palm = panda_model.kinematics(q).position[panda_model.link_index("panda_hand")]
    way = [at_depth(panda_model, q, EYE, far + share * (palm - far)) for share in np.linspace(0.0, 1.0, 400)]
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 0.03


@pytest.mark.parametrize("eye", [(np.nan, 0.0, 0.0), (1.0, 2.0)])
def test_an_eye_that_is_no_place_is_refused(panda_model: RobotModel, eye: tuple[float, ...]) -> None:
    mouse = Mouse(np.zeros(3), SceneSpec(), HandSpec())
    with pytest.raises(ParameterError, match="The camera's position is"):
        mouse.point(np.array(eye), np.zeros(3), panda_model, panda_model.description.q_ready)
