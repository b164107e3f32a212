"""What may be learnt as a load: a weight at the end-effector, and nothing else that lasts."""

import numpy as np
import pytest
from tests.contact.alone import begun as feel_init
from tests.contact.alone import feel

from pretouch.contact.lasting_load import is_load
from pretouch.perception.closest import no_obstacles
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, RobotState

MODEL = RobotModel(panda())
Q = MODEL.description.q_ready
KIN = MODEL.kinematics(Q)
J = MODEL.ee_jacobian(KIN)
KG = J[:3].T @ np.array([0.0, 0.0, -9.81])
STILL = np.zeros(7)
PRETOUCH = profile("pretouch:window.samples=10:detect.relearn_after_s=1")
NOTHING = no_obstacles()


@pytest.mark.parametrize(
    ("residual", "known", "load"),
    [
        (0.5 * KG, 0.0, True),
        (-0.5 * KG, 0.5, True),
        (-0.5 * KG, 0.0, False),
        (5.0 * KG, 0.0, False),
        (J[:3].T @ np.array([10.0, 0.0, 0.0]), 0.0, False),
        (0.5 * KG + J[3] * 0.5, 0.0, True),
        (0.5 * KG + J[3] * 5.0, 0.0, False),
    ],
    ids=["gripped", "put down", "pushed from below", "too heavy", "pushed aside", "off the axis", "far off it"],
)
def test_a_weight_is_a_load_and_another_force_is_not(residual, known, load):
    assert is_load(residual, known * KG, KG, J, 0.05 * np.eye(7), 32) is load


def robot(tau_ext: np.ndarray) -> RobotState:
    return RobotState(0.0, Q, STILL, Q, STILL, tau_ext, np.zeros(6))


def evidence_after(torque: np.ndarray, near: Obstacles = NOTHING, watched: bool = True, p=PRETOUCH) -> float:
    rng, state = np.random.default_rng(4), feel_init(MODEL, p)
    for k in range(500):
        sample = 0.1 * rng.standard_normal(7) + (torque if k >= 250 else 0.0)
        found, state = feel(
            state, MODEL, KIN, robot(sample), near if k >= 250 else NOTHING, k > 251, p, watched or k < 250
        )
    return found.evidence


def close() -> Obstacles:
    at, up = KIN.position[MODEL.ee], np.array([0.0, 0.0, 1.0])
    return Obstacles(
        np.zeros(1, np.int64), (at + 0.2 * up)[None], np.array([0.2]), at[None], np.array([MODEL.ee]), up[None],
        np.array([0.2]), np.zeros(1),
    )  # fmt: skip


def test_a_load_is_felt_and_learnt_once_it_has_lasted():
    assert evidence_after(KG) < 0.3


@pytest.mark.parametrize(
    "how",
    [{"near": close()}, {"watched": False}, {"p": profile("pretouch:detect.relearn_after_s=0")}],
    ids=["something near", "a unit silent", "switched off"],
)
def test_it_is_not_learnt_near_something_unwatched_or_when_told_not_to(how):
    assert evidence_after(KG, **how) >= 1.0


def test_a_lasting_push_aside_is_never_learnt():
    assert evidence_after(J[:3].T @ np.array([0.0, 12.0, 0.0])) >= 1.0


def alone(joint: int, torque: float) -> np.ndarray:
    return torque * np.eye(7)[joint]


@pytest.mark.parametrize("joint", [0, 3, 5])
def test_a_small_step_of_one_joint_is_learnt(joint):
    assert evidence_after(alone(joint, 1.5)) < 0.3


def test_a_larger_one_is_not():
    assert evidence_after(alone(0, 3.0)) >= 1.0


def test_what_is_learnt_of_one_joint_does_not_add_up():
    """Each step would be small enough: a person who pushes back again and again is not learnt step by step."""
    rng, state = np.random.default_rng(4), feel_init(MODEL, PRETOUCH)
    for k in range(1200):
        pushed = 1.5 * max(0, k // 250) * np.eye(7)[0]
        found, state = feel(state, MODEL, KIN, robot(0.1 * rng.standard_normal(7) + pushed), NOTHING, k > 251, PRETOUCH)
    assert found.evidence >= 1.0


def test_a_push_straight_down_that_varies_is_not_learnt():
    rng, state = np.random.default_rng(4), feel_init(MODEL, PRETOUCH)
    for k in range(800):
        push = 2.5 * KG * (1.0 + 0.3 * np.sin(0.06 * k)) if k >= 250 else np.zeros(7)
        found, state = feel(state, MODEL, KIN, robot(0.1 * rng.standard_normal(7) + push), NOTHING, k > 251, PRETOUCH)
        assert k < 300 or found.evidence >= 1.0


def test_it_is_said_that_it_is_being_found_out():
    state = feel_init(MODEL, PRETOUCH)
    rng, said = np.random.default_rng(4), []
    for k in range(500):
        sample = 0.1 * rng.standard_normal(7) + (KG if k >= 250 else 0.0)
        found, state = feel(state, MODEL, KIN, robot(sample), NOTHING, k > 251, PRETOUCH)
        said.append(found.lasting)
    assert not any(said[:250])
    assert all(said[300:340])
    assert not any(said[450:])
