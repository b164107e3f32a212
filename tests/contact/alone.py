"""A detector given one sample after the other with nothing around it, and an arm that stands."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.contact.detector import Body, Detection, Sample
from pretouch.contact.scatter import LENGTHS, WindowMeans, means_in_free_motion, scatter_init
from pretouch.contact.sequential_test import SequentialTest, SequentialTestState
from pretouch.contact.window import Window, add_force, window_init
from pretouch.profiles import Profile
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, Obstacles, RobotState, TouchReadings, no_obstacles


@dataclass(frozen=True)
class Alone:
    """What is remembered."""

    window: Window
    state: Any


def body_of(model: RobotModel, profile: Profile, skin: Skin | None = None) -> Body:
    return Body(model, skin or Skin((), model), profile.task.control_period_s)


def begun(model: RobotModel, profile: Profile, skin: Skin | None = None) -> Alone:
    return Alone(window_init(profile.window.samples), profile.detect.init(body_of(model, profile, skin)))


def feel(
    before: Alone, model: RobotModel, kin: Kinematics, robot: RobotState, obstacles: Obstacles, reacting: bool,
    profile: Profile, watched: bool = True, skin: Skin | None = None, touches: TouchReadings | None = None,
) -> tuple[Detection, Alone]:  # fmt: skip
    """Take in one sample."""
    window = add_force(before.window, None if robot.wrench is None else robot.wrench[:3], profile.window)
    given = Sample(robot.stamp, kin, robot, window, before.window.full, obstacles, reacting, watched, touches)
    found, state = profile.detect.step(before.state, body_of(model, profile, skin), given)
    return found, Alone(before.window if reacting and profile.window.freeze_while_reacting else window, state)


def sample(
    kin: Kinematics, robot: RobotState, near: Obstacles, now: float, touches: TouchReadings | None = None
) -> Sample:
    """A step in which units felt something."""
    return Sample(now, kin, robot, window_init(2), True, near, touches=touches)


def standing(
    model: RobotModel, tau_ext: FloatArray | None = None, wrench: FloatArray | None = None, stamp: float = 0.0
) -> RobotState:
    """The arm at rest in its ready posture, with these torques [Nm] and wrench [N, Nm], else with nothing felt."""
    q, still = model.description.q_ready, np.zeros(model.n)
    return RobotState(
        stamp, q, still, q, still, still if tau_ext is None else tau_ext, np.zeros(6) if wrench is None else wrench
    )


def something(
    link: int, at: FloatArray, away: FloatArray, distance: float, ee_distance: float, closing: float = 0.0
) -> Obstacles:
    """One object so far from a place (3,) of a link's surface [m], in a direction (3,) away from it, coming closer."""
    return no_obstacles(1)._replace(
        point=(at + distance * away)[None], ee_distance=np.array([ee_distance]), body_point=at[None],
        link=np.array([link]), direction=away[None], body_distance=np.array([distance]),
        closing_speed=np.array([closing]),
    )  # fmt: skip


# an arm that stands, in noise of its own, for the sequential test


PERIOD = 0.01


def means_of(
    S: np.ndarray, model_variance: np.ndarray | float = 0.0, scatter: np.ndarray | None = None,
    mean: np.ndarray | None = None, whole: int = len(LENGTHS),
) -> WindowMeans:  # fmt: skip
    """Means (6, n) of residuals with noise (n, n), white without a scatter."""
    n = len(S)
    mean = np.zeros((len(LENGTHS), n)) if mean is None else mean
    scatter = scatter_init(n)[0] if scatter is None else scatter
    return means_in_free_motion(mean, whole, S, np.full(n, model_variance), scatter)


class StandingArm:
    """A Panda at rest in one posture, with noise that no unit can have caused."""

    def __init__(self, model: RobotModel, seed: int) -> None:
        self.test = SequentialTest(learn="always")
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
