"""A held or reacting arm under a bias of its torque estimate: it stands, says what is wrong, and a push moves it."""

from copy import copy

import numpy as np
import pytest

from pretouch.types import ControlStep, Mode
from tests.test_yielding import OURS, Pushed

SILENT = {0: 10.0}
PUSHES = [
    ("panda_hand", (0.0, 15.0, 0.0)), ("panda_hand", (0.0, 0.0, -15.0)), ("panda_hand", (15.0, 0.0, 0.0)),
    ("panda_link4", (15.0, 0.0, 0.0)), ("panda_link4", (-15.0, 0.0, 0.0)),
]  # fmt: skip


class Noisy(Pushed):
    """An arm whose joint torques have noise and, from some instant on, a bias."""

    def __init__(self, model, skin, seed: int, params=OURS) -> None:
        super().__init__(model, skin, params)
        self.rng, self.bias = np.random.default_rng(seed), np.zeros(7)

    def pushed(self, cycles: int, force=(0.0, 0.0, 0.0), link: str = "panda_hand", **more: object) -> list[ControlStep]:
        steps = []
        for _ in range(cycles):
            k, kin = self.model.link_index(link), self.model.kinematics(self.q)
            push = self.model.jacobian(kin, k, kin.position[k])[:3].T @ np.array(force)
            # measured velocities are off by 0.008 rad/s, and the observer has a gain of 60 1/s
            noise = self.model.mass_matrix(self.q) @ (0.48 * self.rng.standard_normal(7))
            steps.append(self.feel(push + self.bias + noise, **more))
        return steps

    def again(self, seed: int, bias: np.ndarray) -> "Noisy":
        """Return an arm that goes on from here with noise of its own: a step changes no state, it makes another."""
        arm = copy(self)
        arm.rng, arm.bias = np.random.default_rng(seed), bias
        return arm


@pytest.fixture(scope="module")
def going(panda_model, paper_skin) -> Noisy:
    arm = Noisy(panda_model, paper_skin, 1000)
    arm.pushed(400)
    assert arm.state.mode.mode is Mode.TRACK
    return arm


@pytest.fixture(scope="module")
def held(going: Noisy) -> Noisy:
    """An arm that holds softly, for one unit is silent."""
    arm = going.again(1001, np.zeros(7))
    arm.pushed(100, silent=SILENT)
    assert arm.state.mode.soft
    return arm


def test_a_soft_hold_stands_exactly_still_with_noise(held: Noisy):
    assert not any(s.command.any() for s in held.again(1002, np.zeros(7)).pushed(500, silent=SILENT))


@pytest.mark.parametrize("joint", [0, 1, 3, 5, 6])
def test_a_soft_hold_stands_exactly_still_with_a_bias_too(held: Noisy, joint: int):
    steps = held.again(1003 + joint, 2.0 * np.eye(7)[joint]).pushed(1000, silent=SILENT)
    assert not any(s.command.any() for s in steps)
    assert {s.mode for s in steps} == {Mode.HOLD}, "what moves nothing is no contact to a held arm"


@pytest.mark.parametrize("bias", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_push_of_15_n_moves_a_held_arm(held: Noisy, bias: float):
    biases = np.full(7, bias) * np.array([1, -1, 1, -1, 1, -1, 1])
    used_to_it = held.again(1010, biases)
    used_to_it.pushed(200, silent=SILENT)
    for i, (link, force) in enumerate(PUSHES):
        arm = used_to_it.again(1011 + i, biases)
        before = arm.point(link)
        arm.pushed(150, force, link, silent=SILENT)
        assert (arm.point(link) - before) @ np.array(force) > 15.0 * 0.02, (link, force)
        arm.pushed(150, silent=SILENT)
        stood = arm.pushed(200, silent=SILENT)
        assert not any(s.command.any() for s in stood), f"and it stands where it is left: {link}, {force}"


@pytest.mark.parametrize("joint", [0, *(pytest.param(joint, marks=pytest.mark.slow) for joint in (3, 5))])
def test_under_a_bias_that_is_not_learnt_a_reacting_arm_holds_and_says_why(going: Noisy, joint: int):
    arm = going.again(1020 + joint, 2.0 * np.eye(7)[joint])
    seen = {0: 0.06}  # with something so near nothing is learnt
    steps = arm.pushed(1500, seen=seen)
    assert any(s.mode is Mode.REACT for s in steps)
    stood = steps[300:]
    assert not any(s.command.any() for s in stood)
    assert stood[-1].mode is Mode.HOLD
    assert "force that does not move the arm" in stood[-1].reason
    assert f"joint {joint + 1}" in stood[-1].reason
    arm.bias = np.zeros(7)
    assert any(s.mode is Mode.TRACK for s in arm.pushed(300, seen=seen)), "gone, the arm goes on"
