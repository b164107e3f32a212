"""A trained policy drives the arm of the live page."""

from typing import TYPE_CHECKING

import numpy as np

from pretouch.desired import Desired
from pretouch.errors import ExperimentError
from pretouch.types import FloatArray
from pretouch_lab.learning.observation import CYCLES, HELD, NEAR_M, Interface
from pretouch_lab.learning.policy import Policy

if TYPE_CHECKING:
    from pretouch.viewer.simulation import LiveSimulation


class PolicyCommander:
    """Takes a policy to places on the path of a live simulation, one after the other: its `commander`."""

    def __init__(self, policy: Policy, simulation: "LiveSimulation", seed: int = 0) -> None:
        """Begin; a policy for another skin or other actions is an ExperimentError. The seed draws the places."""
        self._policy, self._simulation, self._rng = policy, simulation, np.random.default_rng(seed)
        self._interface = Interface(simulation.model, len(simulation.skin))
        sizes = [len(low) for low, _ in self._interface.bounds().values()]
        width, moved = policy.layers[-1][0].shape[0], len(self._interface.scale)
        if len(policy.mean) != sum(sizes) or width != moved:
            raise ExperimentError(
                f"The policy is given {len(policy.mean)} numbers and answers {width}, not {sum(sizes)} and {moved}:"
                " give one that was trained with twists and the page's skin."
            )
        self._begin(0.0)

    def _begin(self, now: float) -> None:
        self._asked: Desired | None = None
        self._last, self._near = now, 0
        self.goal = self._drawn()
        """(3,) where the end-effector is to be [m]."""

    def _drawn(self) -> FloatArray:
        path = self._simulation.controller.path
        x, y, z = goal = path.point(self._rng.uniform(0.0, path.length))
        self._simulation.notice = f"The policy goes to ({x:.2f}, {y:.2f}, {z:.2f}) m."
        return goal

    def __call__(self, now: float) -> Desired | None:
        """Return what the policy asks at an instant [s], by what was observed at the last step of its own."""
        inputs, step = self._simulation.frame.inputs, self._simulation.frame.step
        if now < self._last:  # the simulation began again
            self._begin(now)
        if inputs is None or (self._asked and step.stamp - self._last < (CYCLES - 0.5) * self._period):
            return self._asked
        self._near = self._near + 1 if np.linalg.norm(self.goal - step.ee_position) < NEAR_M else 0
        if self._near == HELD:
            self._near, self.goal = 0, self._drawn()
        self._last = step.stamp
        observation = self._interface.observe(inputs.robot, inputs.readings, self.goal)
        self._asked = self._interface.desired(step.stamp, self._policy.act(observation))
        return self._asked

    @property
    def _period(self) -> float:
        return self._simulation.controller.limits.period
