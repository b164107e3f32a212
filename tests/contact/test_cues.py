from dataclasses import replace

import numpy as np
import pytest
from tests.contact.alone import begun as feel_init
from tests.contact.alone import feel

from pretouch.contact.cues import Cues, no_cues, together
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, Obstacles, RobotState

OURS = profile("pretouch")
NONE = np.zeros(0)
FREE = Obstacles(NONE.astype(np.int64), np.zeros((0, 3)), NONE, np.zeros((0, 3)), NONE.astype(np.int64),
                 np.zeros((0, 3)), NONE, NONE)  # fmt: skip


def evidence_of(model: RobotModel, torque: FloatArray, cues: Cues | None) -> float:
    """Evidence of the fifth of five samples of torques (n,) [Nm] on an arm at rest that has felt nothing before."""
    q, still = model.description.q_ready, np.zeros(model.n)
    kin, state, found = model.kinematics(q), feel_init(model, OURS), 0.0
    for k in range(5):
        robot = RobotState(0.02 * k, q, still, q, still, torque, np.zeros(6))
        felt, state = feel(state, model, kin, robot, FREE, False, OURS, True, cues)
        found = felt.evidence
    return found


def push(model: RobotModel, link: str, newtons: float) -> FloatArray:
    kin, index = model.kinematics(model.description.q_ready), model.link_index(link)
    J = model.jacobian(kin, index, kin.position[index])[:3]
    return np.asarray(J.T @ np.array([0.0, newtons, 0.0]))


def test_units_that_say_nothing_change_no_bit(panda_model: RobotModel) -> None:
    torque = push(panda_model, "panda_link5", 9.0)
    assert evidence_of(panda_model, torque, None) == evidence_of(panda_model, torque, no_cues(len(panda_model.links)))


def test_a_cue_at_the_link_that_is_pushed_makes_the_same_torque_more_evidence(panda_model: RobotModel) -> None:
    torque, quiet = push(panda_model, "panda_link5", 9.0), no_cues(len(panda_model.links))
    gain = quiet.gain.copy()
    gain[panda_model.link_index("panda_link5")] = 100.0
    assert evidence_of(panda_model, torque, replace(quiet, gain=gain)) > evidence_of(panda_model, torque, quiet) > 0.0


def test_a_cue_alone_is_no_contact(panda_model: RobotModel) -> None:
    gain = np.full(len(panda_model.links), 100.0)
    assert evidence_of(panda_model, np.zeros(panda_model.n), replace(no_cues(len(gain)), gain=gain)) < 1.0


def test_gains_multiply_and_places_add_up() -> None:
    one = Cues(np.array([1.0, 2.0, 3.0]), np.array([1]), np.array([[0.1, 0.2, 0.3]]), np.array([0.01]), np.array([4.0]))
    two = Cues(np.array([1.0, 5.0, 0.5]), np.array([2]), np.array([[0.4, 0.5, 0.6]]), np.array([0.02]), np.array([7.0]))
    both = together(one, no_cues(3), two)
    assert both.gain == pytest.approx([1.0, 10.0, 1.5])
    assert both.link.tolist() == [1, 2]
    assert both.point.tolist() == [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]
    assert both.sigma.tolist() == [0.01, 0.02]
    assert both.force.tolist() == [4.0, 7.0]
    assert together(one) is one
