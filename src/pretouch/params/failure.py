"""Parameters of failure: when to stop trusting the inputs."""

from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, Positive, PositiveCount


@dataclass(frozen=True)
class FailureParams(Checked):
    """When to stop trusting the inputs."""

    state_timeout_s: Annotated[float, Check(low=0.0, high=1.0, open_low=True)] = 0.05
    """Age of the robot state at which the arm holds [s]. As long are commands remembered."""
    overrun_s: Positive = 0.05
    """Time between two steps from which the later one brakes [s]: a command is meant to be held for one period."""
    force_max_n: Positive = 1e5
    """Wrench component from which an estimate is no estimate [N, Nm]: far more than any arm survives. Let in, it would
    spoil the window's sums."""
    force_timeout_s: Positive = 0.2
    """Time without a force estimate after which the arm holds [s]."""
    desired_timeout_s: Positive = 0.1
    """Time after the last instant of a desired motion from which the arm is brought to rest [s]: a few messages of a
    commander at 50 Hz may be late or lost."""
    solver_iterations: PositiveCount = 500
    """Iterations of the QP solver after which the arm brakes. A bound on its time that is the same in each replay; most
    steps need less than 10."""
