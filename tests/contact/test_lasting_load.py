"""What may be learnt as a load: a weight at the end-effector, and nothing else that lasts."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.contact.alone import begun as feel_init
from tests.contact.alone import feel, something, standing

from pretouch.contact.detector import Detection
from pretouch.contact.lasting_load import load_misfit, tilt_into
from pretouch.profiles import Profile, profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, no_obstacles

MODEL = RobotModel(panda())
KIN = MODEL.kinematics(MODEL.description.q_ready)
J = MODEL.ee_jacobian(KIN)
KG = J[:3].T @ np.array([0.0, 0.0, -9.81])
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
    found = load_misfit(residual, known * KG, KG, J[3:5], 0.05 * np.eye(7), np.empty(3))
    assert (found < np.inf) is load


def test_a_load_beside_the_hand_of_a_tilted_arm_is_a_load_with_its_moments():
    model = RobotModel(replace(panda(), gravity=np.array([0.6, 0.0, -0.8])))
    tilt, load, (force, beside) = np.empty((2, 7)), np.empty(3), (0.5 * model.gravity, np.array([0.05, 0.1, 0.0]))
    tilt_into(model.mechanism.upright, J, tilt)
    torque = J[:3].T @ force + J[3:].T @ np.cross(beside, force)
    left = load_misfit(torque, np.zeros(7), J[:3].T @ model.gravity, tilt, 0.05 * np.eye(7), load)
    assert left < 0.1
    assert load[0] == pytest.approx(0.5, abs=0.02)
    # standing, the torques of twice the load would be those of a push aside, by 6 N: 3 N may be friction
    assert load_misfit(2.0 * torque, np.zeros(7), KG, J[3:5], 0.05 * np.eye(7), load) == np.inf


def course(
    torque: Callable[[int], np.ndarray], samples: int = 500, near: Obstacles = NOTHING, watched: bool = True,
    p: Profile = PRETOUCH,
) -> list[Detection]:  # fmt: skip
    """What is said while a torque (7,) [Nm] acts on an arm that soon reacts, from the 250th sample on and so near."""
    rng, state, said = np.random.default_rng(4), feel_init(MODEL, p), []
    for k in range(samples):
        acts = k >= 250
        sample = 0.1 * rng.standard_normal(7) + (torque(k) if acts else 0.0)
        found, state = feel(
            state, MODEL, KIN, standing(MODEL, sample), near if acts else NOTHING, k > 251, p, watched or not acts
        )
        said.append(found)
    return said


def alone(joint: int, torque: float) -> np.ndarray:
    return torque * np.eye(7)[joint]


def test_a_load_is_felt_and_learnt_once_it_has_lasted_and_it_is_said_that_it_is_being_found_out():
    said = course(lambda _: KG)
    assert said[-1].evidence < 0.3
    lasting = [found.lasting for found in said]
    assert not any(lasting[:250])
    assert all(lasting[300:340])
    assert not any(lasting[450:])


CLOSE = something(MODEL.ee, KIN.position[MODEL.ee], np.array([0.0, 0.0, 1.0]), 0.2, 0.2)


@pytest.mark.parametrize(
    ("torque", "how"),
    [
        (KG, {"near": CLOSE}),
        (KG, {"watched": False}),
        (KG, {"p": profile("pretouch:detect.relearn_after_s=0")}),
        (J[:3].T @ np.array([0.0, 12.0, 0.0]), {}),
        (alone(0, 3.0), {}),
    ],
    ids=["something near", "a unit silent", "switched off", "pushed aside", "a large step of one joint"],
)
def test_what_is_not_learnt(torque, how):
    assert course(lambda _: torque, **how)[-1].evidence >= 1.0


@pytest.mark.parametrize("joint", [0, 3, 5])
def test_a_small_step_of_one_joint_is_learnt(joint):
    assert course(lambda _: alone(joint, 1.5))[-1].evidence < 0.3


def test_what_is_learnt_of_one_joint_does_not_add_up():
    """Each step would be small enough: a person who pushes back again and again is not learnt step by step."""
    assert course(lambda k: alone(0, 1.5 * (k // 250)), 1200)[-1].evidence >= 1.0


def test_a_push_straight_down_that_varies_is_not_learnt():
    said = course(lambda k: 2.5 * KG * (1.0 + 0.3 * np.sin(0.06 * k)), 800)
    assert min(found.evidence for found in said[300:]) >= 1.0
