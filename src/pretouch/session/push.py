"""The guided push: a person pushes the standing arm, and the force that the robot measures must be that push.

Some stacks report the force on the robot, others the force by it, and the difference does not show until the arm moves
towards whoever pushes it. So it is shown before: pushes along the three axes of the base tell the sign, and that the
force is given in the base frame. Two would not do: a force by the arm in a frame half a turn about z away reads as
asked along x and y, and up is down.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from pretouch.errors import RobotError
from pretouch.ports import Clock, Robot
from pretouch.robot.model import RobotModel
from pretouch.session.may_move import MEAN_S, Standstill, new_states, vector
from pretouch.types import FloatArray, RobotState

# What makes a push a clear one. Figures without a source are ours.
FORCE_N = 8.0
"""Least force, beyond that at rest [N]: a gentle push has 10 to 20."""
NOISE_SIGMAS = 4.0
"""Least force in standard deviations of single samples of the force at rest."""
CONE_RAD = 0.6
"""Largest angle between the push and what was asked for [rad]."""
LASTING_S = 0.5
"""How long it must last [s]."""
AGREEMENT = 0.8
"""Least cosine between the joint torques that the push makes by the Jacobian, and those the robot reports."""
RELEASE_S = 0.5
"""How long nobody may push before the next push [s]."""
TIMEOUT_S = 60.0
"""How long a push is waited for [s]."""


@dataclass(frozen=True)
class Direction:
    """Direction in which a person is asked to push the hand."""

    axis: tuple[float, float, float]
    """Unit vector, base frame."""
    words: str


DIRECTIONS = (
    Direction((0.0, 1.0, 0.0), "+y, to the left from the base looking out over the arm, its mounting underfoot"),
    Direction((1.0, 0.0, 0.0), "+x, straight away from the base"),
    Direction((0.0, 0.0, 1.0), "+z, straight away from what the base is mounted on: up from below if the arm stands"),
)


class PushVerdict(Enum):
    """Result of a push."""

    AS_ASKED = "as asked"
    OPPOSITE = "opposite"
    SIDEWAYS = "sideways"
    CONTRADICTORY = "contradictory"
    """The joint torques have the other sign than the force."""
    DOUBTFUL = "doubtful"
    """The joint torques do not fit the force."""


class PushEvaluator:
    """Evaluates one push, state by state."""

    def __init__(self, model: RobotModel, rest: Standstill, direction: Direction) -> None:
        """Take the arm, its measurements at rest, and the direction of the push."""
        self._model, self._axis = model, np.array(direction.axis)
        self._rest_wrench, self._rest_torque = rest.rest_wrench, rest.rest_torque
        self._least = max(FORCE_N, NOISE_SIGMAS * float(rest.noise.max()))
        self._newest: deque[tuple[float, FloatArray]] = deque()
        self._push: list[tuple[float, FloatArray, FloatArray]] = []
        self.force = np.zeros(3)
        """Force now, beyond that at rest, averaged over `MEAN_S` [N]."""

    @property
    def pushed(self) -> bool:
        """True while somebody pushes."""
        return bool(np.linalg.norm(self.force) >= self._least)

    def take(self, state: RobotState) -> PushVerdict | None:
        """Take a state; return a verdict once a push has lasted long enough, and again each time it has."""
        if state.wrench is None:
            return None
        wrench = state.wrench - self._rest_wrench
        self._newest.append((state.stamp, wrench[:3]))
        while self._newest[0][0] < state.stamp - MEAN_S:
            self._newest.popleft()
        self.force = np.mean([force for _, force in self._newest], axis=0)
        if not self.pushed:
            self._push.clear()
            return None
        self._push.append((state.stamp, wrench, state.tau_ext - self._rest_torque))
        if state.stamp - self._push[0][0] < LASTING_S:
            return None
        _, wrenches, torques = zip(*self._push, strict=True)
        self._push.clear()
        return self._verdict(state.q, np.mean(wrenches, axis=0), np.mean(torques, axis=0))

    def _verdict(self, q: FloatArray, wrench: FloatArray, torque: FloatArray) -> PushVerdict:
        if np.all(np.isfinite(torque)):  # an arm on ROS 2 may give none
            agreement = _cosine(self._model.ee_jacobian(self._model.kinematics(q)).T @ wrench, torque)
            if agreement < AGREEMENT:
                return PushVerdict.CONTRADICTORY if agreement < -AGREEMENT else PushVerdict.DOUBTFUL
        along = _cosine(wrench[:3], self._axis)
        if abs(along) < np.cos(CONE_RAD):
            return PushVerdict.SIDEWAYS
        return PushVerdict.AS_ASKED if along > 0 else PushVerdict.OPPOSITE


def _cosine(a: FloatArray, b: FloatArray) -> float:
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


_RETRY_HINTS = {
    PushVerdict.SIDEWAYS: "The measured push is {force} N, not along the requested axis: push straight along it.",
    PushVerdict.DOUBTFUL: "The joint torques do not match the force of {force} N: push at the hand, not at the arm.",
}

_SIGN_ERRORS = {
    PushVerdict.OPPOSITE: (
        "The reported force is opposite to the pushes: it is the force by the robot, not on it, and the arm would move"
        " towards whoever touches it. Correct the sign setting."
    ),
    PushVerdict.CONTRADICTORY: (
        "The robot's force and its joint torques contradict each other: one is by the arm, the other on it. Correct the"
        " sign of one of them in its driver."
    ),
}
_INCONSISTENT = (
    "Some pushes were measured in the requested direction and others were not: either the force is not given in the"
    " base frame, or a push went elsewhere. Check the settings of frame and sign, and push again."
)


@dataclass(frozen=True)
class GuidedPush:
    """Asks for the pushes, and decides. It only reads the arm."""

    robot: Robot
    clock: Clock
    model: RobotModel
    ask: Callable[[Direction], None]
    """Called as a push is wanted."""
    say: Callable[[str], None]

    def confirm(self, rest: Standstill) -> None:
        """Return once force sign and frame are confirmed; raise RobotError where they are wrong, or stay unclear.

        Args:
            rest: the arm while nobody touched it.
        """
        verdicts = []
        for direction in DIRECTIONS:
            evaluator = PushEvaluator(self.model, rest, direction)
            self.ask(direction)
            verdicts.append(self._wait(evaluator, direction))
            self.say(f"Measured: {vector(evaluator.force, 0, '+')} N. Let go.")
            self._wait_for_release(evaluator)
        wrong = set(verdicts) - {PushVerdict.AS_ASKED}
        if wrong:
            same = len(set(verdicts)) == 1
            raise RobotError(f"{_SIGN_ERRORS[wrong.pop()] if same else _INCONSISTENT} The arm is not moved.")

    def _wait(self, evaluator: PushEvaluator, direction: Direction) -> PushVerdict:
        """Wait for a push that is clear."""
        for state in filter(None, new_states(self.robot, self.clock, self.model.description.qd_max, TIMEOUT_S)):
            verdict = evaluator.take(state)
            if verdict in _RETRY_HINTS:
                self.say(_RETRY_HINTS[verdict].format(force=vector(evaluator.force, 0, "+")))
            elif verdict is not None:
                return verdict
        raise RobotError(
            f"No clear push towards {direction.words} was measured within {TIMEOUT_S:g} s, so the arm is"
            " not moved: start again when somebody is there to push."
        )

    def _wait_for_release(self, evaluator: PushEvaluator) -> None:
        """Wait until nobody pushes."""
        since = None
        for state in filter(None, new_states(self.robot, self.clock, self.model.description.qd_max, TIMEOUT_S)):
            evaluator.take(state)
            since = None if evaluator.pushed else state.stamp if since is None else since
            if since is not None and state.stamp - since >= RELEASE_S:
                return
        raise RobotError(
            f"The push did not end within {TIMEOUT_S:g} s, so the arm is not moved: check what presses against it."
        )
