"""What the QP tracks where the hand's orientation is held."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch.control.task import twist
from pretouch.robot.kinematics import rotation_error


def test_held_orientation_adds_the_turn_back():
    # 30 degrees to go about z at 2 1/s: 2 * sin(30 deg) = 1 rad/s
    goal = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    both = twist(np.array([0.1, 0.2, 0.3]), np.eye(3), goal, 2.0)
    np.testing.assert_allclose(both, [0.1, 0.2, 0.3, 0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_rotation_error_is_axis_times_sine_in_the_base_frame(seed: int):
    rng = np.random.default_rng(seed)
    rotation, goal = Rotation.random(2, rng)
    # the turn from one to the other in the base frame is goal * rotation^-1
    turn = (goal * rotation.inv()).as_rotvec()
    angle = np.linalg.norm(turn)
    expected = turn / angle * np.sin(angle)
    np.testing.assert_allclose(rotation_error(rotation.as_matrix(), goal.as_matrix()), expected, atol=1e-12)
