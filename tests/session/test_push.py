"""The guided push: sign and frame of the force are told from what a person does, and nothing moves."""

import numpy as np
import pytest

from pretouch.errors import RobotError
from pretouch.session.push import DIRECTIONS, GuidedPush, PushParams
from pretouch.session.standstill import watch
from tests.session.arms import PushedArm

PARAMS = PushParams(timeout_s=8.0)


class Person:
    """Pushes an arm for a while after being asked to, by a script of what is asked of it."""

    def __init__(self, push):
        self.push, self.begin, self.wanted, self.asked = push, np.inf, np.zeros(3), 0

    def ask(self, arm):
        def asked(direction):
            self.begin, self.wanted, self.asked = arm.now + 0.3, self.push(np.array(direction.axis)), self.asked + 1

        return asked

    def force(self, time):
        return self.wanted if self.begin <= time < self.begin + 1.0 else np.zeros(3)


def confirmed(model, push=lambda axis: 14.0 * axis, **about_arm):
    """Have a person push, and return what was said; RobotErrors come through."""
    person, said = Person(push), []
    arm = PushedArm(model, person.force, **about_arm)
    rest = watch(arm, arm, model.description.qd_max, 2.0)
    GuidedPush(arm, arm, model, person.ask(arm), said.append, PARAMS).confirm(rest)
    assert person.asked == len(DIRECTIONS)
    return said


@pytest.mark.parametrize("noise", [0.0, 1.8])
def test_a_force_on_the_robot_in_the_base_frame_is_confirmed(panda_model, noise):
    said = confirmed(panda_model, noise=noise)
    assert sum("Let go" in sentence for sentence in said) == 3


def test_a_push_somewhat_askew_still_tells(panda_model):
    confirmed(panda_model, lambda axis: 14.0 * axis + 6.0 * np.roll(axis, 1))


def test_the_force_by_the_robot_is_refused(panda_model):
    with pytest.raises(RobotError, match="force by the robot, not on it"):
        confirmed(panda_model, wrench_sign=-1.0, tau_sign=-1.0)


def test_a_force_in_the_frame_of_a_hand_that_points_down_is_refused(panda_model):
    with pytest.raises(RobotError, match="not given in the base frame"):
        confirmed(panda_model, R=np.diag([1.0, -1.0, -1.0]))


@pytest.mark.parametrize("tau_sign", [1.0, -1.0])
def test_the_force_by_the_robot_in_a_frame_turned_about_z_is_refused_by_the_push_upwards(panda_model, tau_sign):
    with pytest.raises(RobotError, match="not given in the base frame"):
        confirmed(panda_model, R=np.diag([-1.0, -1.0, 1.0]), wrench_sign=-1.0, tau_sign=tau_sign)


def test_a_force_against_the_joint_torques_is_refused(panda_model):
    with pytest.raises(RobotError, match="contradict each other"):
        confirmed(panda_model, wrench_sign=-1.0)


@pytest.mark.parametrize(
    ("push", "said"),
    [
        (lambda axis: 14.0 * np.array([0.0, 0.0, 1.0]), "not along the requested axis"),
        (lambda axis: 5.0 * axis, ""),
        (lambda axis: 0.0 * axis, ""),
    ],
)
def test_what_is_no_clear_push_decides_nothing(panda_model, push, said):
    person, heard = Person(push), []
    arm = PushedArm(panda_model, person.force)
    rest = watch(arm, arm, panda_model.description.qd_max, 1.0)
    with pytest.raises(RobotError, match=r"No clear push .* within 8 s"):
        GuidedPush(arm, arm, panda_model, person.ask(arm), heard.append, PARAMS).confirm(rest)
    assert (said in heard[0]) if said else not heard


def test_an_arm_that_tells_no_joint_torques_is_confirmed_by_its_force_alone(panda_model):
    confirmed(panda_model, tau_sign=np.nan)
    with pytest.raises(RobotError, match="opposite to the pushes"):
        confirmed(panda_model, wrench_sign=-1.0, tau_sign=np.nan)


def test_torques_that_do_not_fit_the_force_are_said_and_decide_nothing(panda_model):
    person, heard = Person(lambda axis: 14.0 * axis), []
    arm = PushedArm(panda_model, person.force, tau_sign=0.0)
    rest = watch(arm, arm, panda_model.description.qd_max, 1.0)
    with pytest.raises(RobotError, match="No clear push"):
        GuidedPush(arm, arm, panda_model, person.ask(arm), heard.append, PARAMS).confirm(rest)
    assert "do not match" in heard[0]


def test_a_push_shorter_than_asked_decides_nothing(panda_model):
    person = Person(lambda axis: 14.0 * axis)
    arm = PushedArm(panda_model, lambda time: person.force(time) if time < person.begin + 0.3 else np.zeros(3))
    rest = watch(arm, arm, panda_model.description.qd_max, 1.0)
    with pytest.raises(RobotError, match="No clear push"):
        GuidedPush(arm, arm, panda_model, person.ask(arm), lambda _: None, PARAMS).confirm(rest)


def test_a_push_that_never_ends_is_an_error(panda_model):
    arm = PushedArm(panda_model)
    rest = watch(arm, arm, panda_model.description.qd_max, 1.0)
    arm.force = lambda time: np.array([0.0, 14.0, 0.0])
    with pytest.raises(RobotError, match="did not end"):
        GuidedPush(arm, arm, panda_model, lambda _: None, lambda _: None, PARAMS).confirm(rest)


def test_a_constant_bias_is_no_push(panda_model):
    person = Person(lambda axis: 14.0 * axis)
    bias = np.array([2.0, -9.0, 3.0])
    arm = PushedArm(panda_model, lambda time: person.force(time) + bias)
    rest = watch(arm, arm, panda_model.description.qd_max, 1.0)
    GuidedPush(arm, arm, panda_model, person.ask(arm), lambda _: None, PARAMS).confirm(rest)
