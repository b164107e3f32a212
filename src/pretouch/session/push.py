"""The guided push: a person pushes the standing arm, and what the robot believes to feel must be that push.

Some stacks report the force on the robot, others the force by it, and the difference does not show until the arm moves
towards whoever pushes it. So it is shown before: pushes along the three axes of the base tell the sign, and that the
force is given in the base frame. Two would not do: a force by the arm in a frame half a turn about z away is felt as
asked along x and y, and up is down.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from pretouch.checks import Checked, Fraction, Positive
from pretouch.errors import RobotError
from pretouch.faults import sound_robot
from pretouch.ports import Clock, Robot
from pretouch.robot.model import RobotModel
from pretouch.session.standing import MEAN_S, Standing
from pretouch.types import FloatArray, RobotState


@dataclass(frozen=True)
class PushParams(Checked):
    """What makes a push a clear one. Figures without a source are ours."""

    force_n: Positive = 8.0
    """Least force, beyond that at rest [N]: a gentle push has 10 to 20."""
    noise_sigmas: Positive = 4.0
    """Least force in standard deviations of single samples of the force at rest."""
    cone_rad: Positive = 0.6
    """Largest angle between the push and what was asked for [rad]."""
    lasting_s: Positive = 0.5
    """How long it must last [s]."""
    agreement: Fraction = 0.8
    """Least cosine between the joint torques that the push makes by the Jacobian, and those the robot reports."""
    release_s: Positive = 0.5
    """How long nobody may push before the next push [s]."""
    timeout_s: Positive = 60.0
    """How long a push is waited for [s]."""


@dataclass(frozen=True)
class Direction:
    """Where a person is asked to push the hand."""

    axis: tuple[float, float, float]
    """Unit vector, base frame."""
    words: str


DIRECTIONS = (
    Direction((0.0, 1.0, 0.0), "+y, to the left as seen from the base looking out over the arm"),
    Direction((1.0, 0.0, 0.0), "+x, straight away from the base"),
    Direction((0.0, 0.0, 1.0), "+z, straight up from below"),
)


class Verdict(Enum):
    """What a push has shown."""

    AS_ASKED = "as asked"
    OPPOSITE = "opposite"
    SIDEWAYS = "sideways"
    CONTRADICTORY = "contradictory"
    """The joint torques have the other sign than the force."""
    DOUBTFUL = "doubtful"
    """The joint torques do not fit the force."""


class Judge:
    """Judges one push, state by state."""

    def __init__(self, model: RobotModel, rest: Standing, direction: Direction, params: PushParams) -> None:
        """Take the arm, what it felt at rest, and where it is pushed."""
        self._model, self._axis, self._params = model, np.array(direction.axis), params
        self._rest_wrench, self._rest_torque = rest.rest_wrench, rest.rest_torque
        self._least = max(params.force_n, params.noise_sigmas * float(rest.noise.max()))
        self._newest: deque[tuple[float, FloatArray]] = deque()
        self._push: list[tuple[float, FloatArray, FloatArray]] = []
        self.force = np.zeros(3)
        """Force now, beyond that at rest, averaged over `MEAN_S` [N]."""

    @property
    def pushed(self) -> bool:
        """Whether somebody pushes."""
        return bool(np.linalg.norm(self.force) >= self._least)

    def take(self, state: RobotState) -> Verdict | None:
        """Take a state in; return a verdict once a push has lasted long enough, and again each time it has."""
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
        if state.stamp - self._push[0][0] < self._params.lasting_s:
            return None
        _, wrenches, torques = zip(*self._push, strict=True)
        self._push.clear()
        return self._judged(state.q, np.mean(wrenches, axis=0), np.mean(torques, axis=0))

    def _judged(self, q: FloatArray, wrench: FloatArray, torque: FloatArray) -> Verdict:
        if np.all(np.isfinite(torque)):  # an arm on ROS 2 tells none
            made = self._model.ee_jacobian(self._model.kinematics(q)).T @ wrench
            agreement = _cosine(made, torque)
            if agreement < -self._params.agreement:
                return Verdict.CONTRADICTORY
            if agreement < self._params.agreement:
                return Verdict.DOUBTFUL
        along = _cosine(wrench[:3], self._axis)
        if abs(along) < np.cos(self._params.cone_rad):
            return Verdict.SIDEWAYS
        return Verdict.AS_ASKED if along > 0 else Verdict.OPPOSITE


def _cosine(a: FloatArray, b: FloatArray) -> float:
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0 else 0.0


_SAID = {
    Verdict.SIDEWAYS: "The push felt goes {force} N, not along the axis asked for: push straight along it.",
    Verdict.DOUBTFUL: "The joint torques do not fit the force of {force} N: push at the hand alone, not at the arm.",
}

_WRONG = {
    Verdict.OPPOSITE: (
        "The force the robot reports is opposite to the pushes: it is the force by the robot, not on it, and the arm"
        " would move against whoever touches it: correct the sign setting."
    ),
    Verdict.CONTRADICTORY: (
        "The robot's force and its joint torques contradict each other: one of the two is by the arm, the other on it:"
        " correct the sign of one in its driver."
    ),
}
_TURNED = (
    "Of the pushes some were felt as they were and others were not: the force is not given in the base frame, or a push"
    " was not where it was asked for: check the settings of frame and sign, and push again."
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
    params: PushParams = PushParams()

    def confirm(self, rest: Standing) -> None:
        """Return once force sign and frame are confirmed; raise RobotError where they are wrong, or stay unclear.

        Args:
            rest: the arm while nobody touched it.
        """
        verdicts = []
        for direction in DIRECTIONS:
            judge = Judge(self.model, rest, direction, self.params)
            self.ask(direction)
            verdicts.append(self._wait(judge, direction))
            self.say(f"Felt: {_vector(judge.force)} N. Let go.")
            self._released(judge)
        wrong = set(verdicts) - {Verdict.AS_ASKED}
        if wrong:
            same = len(set(verdicts)) == 1
            raise RobotError(f"{_WRONG[wrong.pop()] if same else _TURNED} The arm is not moved.")

    def _wait(self, judge: Judge, direction: Direction) -> Verdict:
        """Wait for a push that is clear."""
        for state in self._states(self.params.timeout_s):
            verdict = judge.take(state)
            if verdict in _SAID:
                self.say(_SAID[verdict].format(force=_vector(judge.force)))
            elif verdict is not None:
                return verdict
        raise RobotError(
            f"No clear push towards {direction.words} came within {self.params.timeout_s:g} s: the arm is not moved."
            " Start again when somebody stands by."
        )

    def _released(self, judge: Judge) -> None:
        """Wait until nobody pushes."""
        since = None
        for state in self._states(self.params.timeout_s):
            judge.take(state)
            since = None if judge.pushed else state.stamp if since is None else since
            if since is not None and state.stamp - since >= self.params.release_s:
                return
        raise RobotError(
            f"The push did not end within {self.params.timeout_s:g} s: see what presses against the arm; it is not"
            " moved."
        )

    def _states(self, seconds: float) -> Iterator[RobotState]:
        """Yield the robot's states for some seconds."""
        begin = now = self.clock.tick()
        last = -np.inf
        while now - begin < seconds:
            state, wrong = sound_robot(self.robot.read(), self.model.description.qd_max)
            if state is None:
                raise RobotError(f"The robot's state cannot be used: {wrong}: check the connection to the arm.")
            if state.stamp > last:
                last = state.stamp
                yield state
            now = self.clock.tick()


def _vector(values: FloatArray) -> str:
    return f"({', '.join(f'{value:+.0f}' for value in values)})"
