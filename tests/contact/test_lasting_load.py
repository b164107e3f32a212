"""What may be learnt as a load: a weight at the end-effector, and nothing else that lasts."""

import numpy as np
import pytest

from pretouch.contact.feel import feel, feel_init
from pretouch.contact.lasting_load import is_load
from pretouch.params import profile
from pretouch.perception.closest import no_obstacles
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, RobotState

MODEL = RobotModel(panda())
Q = MODEL.description.q_ready
KIN = MODEL.kinematics(Q)
J = MODEL.ee_jacobian(KIN)
KG = J[:3].T @ np.array([0.0, 0.0, -9.81])
STILL = np.zeros(7)
PRETOUCH = profile("pretouch:threshold.window_samples=10:detection.relearn_after_s=1")
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
    [{"near": close()}, {"watched": False}, {"p": profile("pretouch:detection.relearn_after_s=0")}],
    ids=["something near", "a unit silent", "switched off"],
)
def test_it_is_not_learnt_near_something_unwatched_or_when_told_not_to(how):
    assert evidence_after(KG, **how) >= 1.0


def test_a_lasting_push_aside_is_never_learnt():
    assert evidence_after(J[:3].T @ np.array([0.0, 12.0, 0.0])) >= 1.0
