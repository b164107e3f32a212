"""The product's limiter of set-points against the limits of the served arm, which goes on where a command is lost."""

import numpy as np
import pytest

from pretouch.arms.franka.limiter import SetPointLimiter
from pretouch.arms.franka.limits import LimiterParams, motion_limits
from pretouch.arms.franka.state import FrankaState
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch_fci.kinds import JointVelocity
from pretouch_fci.limits import motion_limits as served_limits
from pretouch_fci.motion import Motion, Setpoint
from pretouch_fci.wire import ControllerMode


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_bursts_of_lost_commands_at_any_time_break_no_limit_of_the_served_arm(kind, seed):
    model, draw = RobotModel(robot_named(kind)), np.random.default_rng([seed, 15])
    limits = motion_limits(model, kind)
    q, limiter = (limits.q_min + limits.q_max) / 2, SetPointLimiter(limits, LimiterParams())
    motion, burst = Motion(served_limits(model, kind), ControllerMode.JOINT_IMPEDANCE, JointVelocity()), Bursts(draw)
    # set-points that change often meet the limits of speed, others those of position
    changes = (0.05, 0.01)[seed % 2]
    wanted, lost = np.zeros(7), 0
    for k in range(6000):
        if k % 10 == 0 and draw.random() < changes:
            wanted = limits.qd_max * draw.choice([-1.0, 0.0, 0.5, 1.0], 7)
        command = np.array(limiter.step(_state(1e-3 * k, q, motion), wanted.tolist()))
        taken = None if burst.takes() else Setpoint(command)
        lost += taken is None
        assert motion.follow(q, taken) is None, k
        q = q + motion.qd * 1e-3
    assert lost > 300


def _state(time: float, q: np.ndarray, motion: Motion) -> FrankaState:
    """What the vendor's library tells of an arm that follows a motion exactly."""
    zero = np.zeros(7)
    return FrankaState(
        time, "move", (), (), q, motion.qd, q.copy(), motion.qd.copy(), motion.qdd.copy(), zero, np.zeros(6), 1.0, 0.0,
        0.0,
    )  # fmt: skip


class Bursts:
    """Loses up to 15 commands in a row, and then takes at least ten."""

    def __init__(self, draw: np.random.Generator) -> None:
        self._draw, self._left = draw, -10

    def takes(self) -> bool:
        if self._left == -10 and self._draw.random() < 0.02:
            self._left = int(self._draw.integers(1, 16))
        self._left = max(-10, self._left - 1)
        return self._left >= 0
