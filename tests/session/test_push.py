"""The guided push: sign and frame of the force are told from what a person does, and nothing moves."""

import numpy as np
import pytest

from pretouch.errors import RobotError
from pretouch.session import push as pushes
from pretouch.session.may_move import watch
from pretouch.session.push import DIRECTIONS, GuidedPush
from tests.session.arms import PushedArm


@pytest.fixture(autouse=True)
def _not_patient(monkeypatch):
    monkeypatch.setattr(pushes, "TIMEOUT_S", 8.0)


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


def confirmed(model, push=lambda axis: 14.0 * axis, said=None, felt=lambda person, time: person.force(time), **about):
    """Have a person push an arm that feels what it does of that, and return what was said; RobotErrors come through."""
    person, said = Person(push), [] if said is None else said
    arm = PushedArm(model, lambda time: felt(person, time), **about)
    rest = watch(arm, arm, model.description.qd_max, 2.0)
    GuidedPush(arm, arm, model, person.ask(arm), said.append).confirm(rest)
    assert person.asked == len(DIRECTIONS)
    return said


@pytest.mark.parametrize(
    "about",
    [
        {"noise": 0.0},
        {"noise": 1.8},
        {"push": lambda axis: 14.0 * axis + 6.0 * np.roll(axis, 1)},  # somewhat askew
        {"tau_sign": np.nan},  # without joint torques
        {"felt": lambda person, time: person.force(time) + np.array([2.0, -9.0, 3.0])},  # a constant bias
    ],
)
def test_a_force_on_the_robot_in_the_base_frame_is_confirmed(panda_model, about):
    said = confirmed(panda_model, **about)
    assert sum("Let go" in sentence for sentence in said) == 3


TURNED = np.diag([-1.0, -1.0, 1.0])
"""Of a frame half a turn about z away: along x and y a force by the robot reads as one on it."""


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ({"wrench_sign": -1.0, "tau_sign": -1.0}, "force by the robot, not on it"),
        ({"R": np.diag([1.0, -1.0, -1.0])}, "not given in the base frame"),  # but in that of a hand that points down
        ({"R": TURNED, "wrench_sign": -1.0, "tau_sign": 1.0}, "not given in the base frame"),
        ({"R": TURNED, "wrench_sign": -1.0, "tau_sign": -1.0}, "not given in the base frame"),
        ({"wrench_sign": -1.0}, "contradict each other"),
        ({"wrench_sign": -1.0, "tau_sign": np.nan}, "opposite to the pushes"),
    ],
)
def test_a_force_that_is_not_the_one_on_the_robot_in_the_base_frame_is_refused(panda_model, about, said):
    with pytest.raises(RobotError, match=said):
        confirmed(panda_model, **about)


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ({"push": lambda axis: 14.0 * np.array([0.0, 0.0, 1.0])}, "not along the requested axis"),
        ({"push": lambda axis: 5.0 * axis}, ""),
        ({"push": lambda axis: 0.0 * axis}, ""),
        ({"tau_sign": 0.0}, "do not match"),
        ({"felt": lambda person, time: person.force(time) * (time < person.begin + 0.3)}, ""),  # shorter than asked
    ],
)
def test_what_is_no_clear_push_or_does_not_fit_the_torques_decides_nothing(panda_model, about, said):
    heard = []
    with pytest.raises(RobotError, match=r"No clear push .* within 8 s"):
        confirmed(panda_model, said=heard, **about)
    assert (said in heard[0]) if said else not heard


def test_a_push_that_never_ends_is_an_error(panda_model):
    with pytest.raises(RobotError, match="did not end"):
        confirmed(panda_model, felt=lambda person, time: np.array([0.0, 14.0 * (person.asked > 0), 0.0]))
