"""The force that the sequential test says it finds, held against pushes of that force."""

import math

import numpy as np
import pytest

from pretouch.contact.detectable import detectable_force
from pretouch.contact.detector import Body, Sample
from pretouch.contact.sequential import log_ratio
from pretouch.contact.sequential_test import SequentialTest, SequentialTestState
from pretouch.contact.window import window_init
from pretouch.contact.window_scatter import scatter_init, scattered_means, white_means
from pretouch.params import MisfitParams
from pretouch.perception.closest import no_obstacles
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import RobotState

GAIN, TAILS, NEEDED = 15.0, 30.0, 10.0
PERIOD = 0.01


def test_by_hand_for_a_cartesian_arm():
    """Three joints of which each moves one axis, with 2, 4 and 1 Nm of noise: the second tells least."""
    J, sigma = np.vstack((np.eye(3), np.zeros((3, 3)))), np.array([2.0, 4.0, 1.0])
    free = white_means(np.diag(sigma**2), np.zeros(3))
    found = detectable_force(J, PERIOD, free, NEEDED, GAIN, TAILS)
    # eight samples fit into 0.1 s
    whitened = found / (4.0 / math.sqrt(8.0)) - 1.645
    square = whitened**2
    ratio = log_ratio(math.log1p((square + 3) / TAILS), square + 3, square + 3, 3, 3, GAIN, math.log1p(GAIN), TAILS)
    assert ratio == pytest.approx(NEEDED, abs=1e-9)


def test_noise_that_lasts_does_not_average_out():
    J = np.vstack((np.eye(3), np.zeros((3, 3))))
    white = detectable_force(J, PERIOD, white_means(np.eye(3), np.zeros(3)), NEEDED, GAIN, TAILS)
    lasting = detectable_force(J, PERIOD, white_means(1e-9 * np.eye(3), np.ones(3)), NEEDED, GAIN, TAILS)
    assert lasting == pytest.approx(math.sqrt(8.0) * white, rel=1e-6)


def test_a_scatter_of_four_doubles_it():
    J = np.vstack((np.eye(3), np.zeros((3, 3))))
    scatter = scatter_init(3)[1]
    scatter[:, :3] = 4.0 * np.eye(3)
    white = detectable_force(J, PERIOD, white_means(np.eye(3), np.zeros(3)), NEEDED, GAIN, TAILS)
    wide = detectable_force(J, PERIOD, scattered_means(np.eye(3), np.zeros(3), scatter), NEEDED, GAIN, TAILS)
    assert wide == pytest.approx(2.0 * white, rel=1e-9)


def test_what_no_joint_shows_and_what_tails_forbid_is_never_found():
    free = white_means(np.eye(3), np.zeros(3))
    assert detectable_force(np.zeros((6, 3)), PERIOD, free, NEEDED, GAIN, TAILS) == math.inf
    across = np.vstack((np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3))))
    assert detectable_force(across, PERIOD, free, NEEDED, GAIN, TAILS) == math.inf
    # with so heavy tails even the largest outlier is no contact
    all_axes = np.vstack((np.eye(3), np.zeros((3, 3))))
    assert detectable_force(all_axes, PERIOD, free, 60.0, GAIN, 3.0) == math.inf


class Arm:
    """A Panda at rest in one posture, with noise that no unit can have caused."""

    def __init__(self, model: RobotModel, misfit: MisfitParams | None, seed: int) -> None:
        self.test = SequentialTest(learn="always", misfit=misfit)
        self.body, self.rng = Body(model, Skin((), model), PERIOD), np.random.default_rng(seed)
        self.q = model.description.q_ready + self.rng.uniform(-0.4, 0.4, model.n)
        self.kin = model.kinematics(self.q)
        self.J = model.ee_jacobian(self.kin)[:3]
        self.sigma, self.window = self.rng.uniform(0.05, 0.4, model.n), window_init(500)

    def sample(self, force: np.ndarray) -> Sample:
        n = self.body.model.n
        tau = self.sigma * self.rng.standard_normal(n) + self.J.T @ force
        robot = RobotState(0.0, self.q, np.zeros(n), self.q, np.zeros(n), tau, None)
        return Sample(0.0, self.kin, robot, self.window, True, no_obstacles(), False, True)

    def learnt(self, steps: int = 4000) -> tuple[SequentialTestState, float]:
        """Return the state after 40 s, and the force that it says it finds."""
        state, says = self.test.init(self.body), math.nan
        for _ in range(steps):
            said, state = self.test.step(state, self.body, self.sample(np.zeros(3)))
            says = said.detectable_n
        return state, says

    def finds(self, state: SequentialTestState, force: np.ndarray) -> bool:
        """Whether a force that is held for 0.1 s is a contact."""
        for _ in range(10):
            said, state = self.test.step(state, self.body, self.sample(force))
            if said.contact is not None:
                return True
        return False


@pytest.mark.parametrize("misfit", [None, MisfitParams()], ids=["without misfit", "with"])
def test_what_it_says_is_found_in_95_of_100_cases_and_less_is_not(panda_model, misfit):
    found, less = [], []
    for seed in range(8):
        arm = Arm(panda_model, misfit, seed)
        state, says = arm.learnt()
        # the direction that the torques tell least of
        worst = np.linalg.eigh(arm.J @ np.diag(1.0 / arm.sigma**2) @ arm.J.T)[1][:, 0]
        sign = arm.rng.choice([-1.0, 1.0], 40)
        found += [arm.finds(state, says * s * worst) for s in sign]
        less += [arm.finds(state, 0.5 * says * s * worst) for s in sign]
    assert np.mean(found) > 0.93
    assert np.mean(less) < 0.5


def test_a_louder_arm_says_a_larger_force(panda_model):
    quiet, loud = Arm(panda_model, MisfitParams(), 3), Arm(panda_model, MisfitParams(), 3)
    loud.sigma = 3.0 * loud.sigma
    # not three times: floors of the noise are in both, and an arm that is as learnt earns a lower level
    assert 1.5 < loud.learnt()[1] / quiet.learnt()[1] <= 3.0
