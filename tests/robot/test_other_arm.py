"""Another arm as moving fixtures: its capsules, placed and moving, in the base frame of the arm beside it."""

import numpy as np
import pytest

from pretouch.arms.other_arm import OtherArm
from pretouch.robot.body import placed
from pretouch.sim.scene import floor_and_pedestal
from pretouch.sound import sound_moving
from pretouch.types import RobotState

T = np.array([[-1.0, 0.0, 0.0, 1.2], [0.0, -1.0, 0.0, 0.3], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]])
"""Turned by half a turn about z, 1.2 m ahead, 0.3 m aside and 0.1 m higher."""


def state(q, qd, stamp=2.0) -> RobotState:
    return RobotState(stamp, q, qd, q, qd, np.zeros(7), None)


def test_before_its_first_state_it_is_somewhere(panda_model):
    assert sound_moving(OtherArm(panda_model, T, lambda: None)(), 0.0, 0.05) == (None, "have not been reported yet")


def test_its_capsules_stand_in_the_frame_of_the_arm_beside_it(panda_model):
    q = panda_model.description.q_ready
    pedestal = floor_and_pedestal(-0.2).capsules
    told = OtherArm(panda_model, T, lambda: state(q, np.zeros(7)), pedestal)()
    _, a, _, _ = placed(panda_model.capsules, panda_model.kinematics(q))
    count = len(panda_model.capsules.radius)
    assert told.stamp == 2.0
    assert told.a[:count] == pytest.approx(a * [-1.0, -1.0, 1.0] + [1.2, 0.3, 0.1])
    # the pedestal, from the floor to its rounded top
    assert told.a[count:] == pytest.approx(np.array([[1.2, 0.3, -0.1]]))
    assert told.b[count:] == pytest.approx(np.array([[1.2, 0.3, 0.0]]))
    assert told.radius[count:].tolist() == [0.1]
    assert not told.a_velocity.any()


def test_its_ends_move_as_its_joints_say(panda_model):
    q, qd = panda_model.description.q_ready, np.array([0.5, -0.4, 0.3, 0.6, -0.2, 0.1, 0.7])
    other = OtherArm(panda_model, T, lambda: None)
    before, now, after = (other.at(state(q + t * qd, qd)) for t in (-1e-6, 0.0, 1e-6))
    for end, speed in (("a", "a_velocity"), ("b", "b_velocity")):
        rate = (getattr(after, end) - getattr(before, end)) / 2e-6
        assert getattr(now, speed) == pytest.approx(rate, abs=1e-6)
    a, _ = now.at(2.0 + 1e-6)
    assert a == pytest.approx(after.a, abs=1e-9)
