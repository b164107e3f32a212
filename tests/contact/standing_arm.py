"""An arm that stands, in noise of its own, for the sequential test."""

import math

import numpy as np

from pretouch.contact.detector import Body, Sample
from pretouch.contact.scatter import LENGTHS, WindowMeans, means_in_free_motion
from pretouch.contact.sequential_test import SequentialTest, SequentialTestState
from pretouch.contact.window import window_init
from pretouch.params import MisfitParams
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import RobotState, no_obstacles

PERIOD = 0.01


def means_of(
    S: np.ndarray, model_variance: np.ndarray | float = 0.0, scatter: np.ndarray | None = None,
    mean: np.ndarray | None = None, whole: int = len(LENGTHS),
) -> WindowMeans:  # fmt: skip
    """Means (6, n) of residuals with noise (n, n), white without a scatter."""
    n = len(S)
    mean = np.zeros((len(LENGTHS), n)) if mean is None else mean
    scatter = np.zeros((0, n + 2, n)) if scatter is None else scatter
    return means_in_free_motion(mean, whole, S, np.full(n, model_variance), scatter)


class StandingArm:
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

    def learnt(self, time: float) -> tuple[SequentialTestState, float]:
        """Return the state after so long [s], and the force that it says it finds."""
        state, says = self.test.init(self.body), math.nan
        for _ in range(round(time / PERIOD)):
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
