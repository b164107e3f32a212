import numpy as np
import pytest

from pretouch.control.path import Circle, segment
from pretouch.errors import PathError
from pretouch.sim.paper_scenes import board_beside
from pretouch.sim.physics import way_round

PATHS = {"circle": Circle(), "line": segment((0.4, -0.5, 0.5), (0.4, 0.5, 0.5))}


@pytest.mark.parametrize(("side", "sign"), [("-y", -1.0), ("+y", 1.0)])
@pytest.mark.parametrize("path", PATHS)
def test_the_board_faces_the_arm_a_quarter_metre_from_its_middle(path, side, sign):
    board = board_beside(PATHS[path], side, 25_000.0)
    (_, y, _), (_, thick, _) = board.center, board.half_size
    assert sign * y - thick == pytest.approx(0.25)
    assert board.stiffness == 25_000.0


def test_the_board_on_the_line_is_where_the_paths_height_and_distance_say():
    board = board_beside(PATHS["line"], "+y", 25_000.0, face=0.3, aside=0.01, above=-0.02)
    assert board.center == pytest.approx((0.4 + 0.12 + 0.01, 0.32, 0.5 + 0.057 - 0.02))


def test_a_path_that_never_comes_to_the_board_is_refused():
    with pytest.raises(PathError, match=r"never comes to the board at y = -0.25 m"):
        board_beside(Circle(radius=0.1), "-y", 25_000.0)


def test_the_way_to_the_other_side_leads_in_front_of_the_arm():
    hand, goal = np.array([0.5, -0.8, 0.4]), np.array([0.5, 0.8, 0.4])
    for _ in range(2000):
        step = way_round(hand, goal) - hand
        length = np.linalg.norm(step)
        hand = hand + step * min(1.0, 0.005 / length) if length > 0 else hand
        assert abs(hand[1]) > 0.4 or hand[0] > 1.0
    assert np.linalg.norm(hand - goal) < 1e-9


def test_a_goal_on_the_same_side_is_reached_straight():
    goal = np.array([0.5, 0.6, 0.4])
    assert way_round(np.array([0.5, 0.8, 0.3]), goal) is goal
