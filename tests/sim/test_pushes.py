import numpy as np

from pretouch.sim.pushes import way_round


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
