"""An arm watched while it stands still: its posture, its drift, and the force it measures."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.errors import RobotError
from pretouch.ports import Clock, Robot
from pretouch.sound import sound_robot
from pretouch.types import FloatArray, RobotState

MEAN_S = 0.1
"""Time over which a force is averaged before it is judged [s]: one sample of a Panda's is off by up to 6 N."""
_ENOUGH = 0.5
"""Share of the usual number of states that a mean needs."""


@dataclass(frozen=True, eq=False)
class Standstill:
    """S states of an arm of n joints, in order."""

    stamp: FloatArray
    """(S,) [s]."""
    q: FloatArray
    """(S, n) joint positions [rad]."""
    qd: FloatArray
    """(S, n) joint velocities [rad/s]."""
    tau_ext: FloatArray
    """(S, n) estimated external torques [Nm]."""
    wrench: FloatArray
    """(S, 6) estimated external force [N] and torque [Nm], NaN where there was no estimate."""
    newest: RobotState

    @property
    def rest_wrench(self) -> FloatArray:
        """Mean wrench (6,), NaN without any estimate."""
        return _mean(self.wrench)

    @property
    def rest_torque(self) -> FloatArray:
        """Mean external torques (n,) [Nm]."""
        return _mean(self.tau_ext)

    @property
    def noise(self) -> FloatArray:
        """Standard deviation of each force component (3,) [N]."""
        force = self.wrench[np.isfinite(self.wrench).all(axis=1), :3]
        return np.array(force.std(axis=0)) if len(force) else np.full(3, np.nan)

    @property
    def missing_share(self) -> float:
        """Share of the states without a force estimate."""
        return float(np.mean(~np.isfinite(self.wrench).all(axis=1)))

    @property
    def disturbance(self) -> float:
        """Largest deviation of the force from its mean, averaged over `MEAN_S` [N].

        A span with fewer than half as many states as is usual is left out: its mean is that of the noise.
        """
        known = np.isfinite(self.wrench).all(axis=1)
        away = self.wrench[known, :3] - self.rest_wrench[:3]
        span = np.floor((self.stamp[known] - self.stamp[0]) / MEAN_S)
        spans, counts = np.unique(span, return_counts=True)
        enough = spans[counts >= _ENOUGH * np.median(counts)] if len(spans) else spans
        means = [away[span == one].mean(axis=0) for one in enough]
        return max((float(np.linalg.norm(mean)) for mean in means), default=0.0)


def _mean(values: FloatArray) -> FloatArray:
    known = values[np.isfinite(values).all(axis=1)]
    return np.array(known.mean(axis=0)) if len(known) else np.full(values.shape[1], np.nan)


def watch(
    robot: Robot, clock: Clock, qd_max: FloatArray, seconds: float, on_tick: Callable[[float], None] = lambda _: None
) -> Standstill:
    """Watch an arm for some seconds.

    Args:
        robot: it is only read.
        clock: gives the ticks at which it is read.
        qd_max: (n,) joint velocity limits [rad/s].
        seconds: how long.
        on_tick: called after each reading with the instant of the tick [s].

    Raises RobotError for a state that cannot be used, and where fewer than one in two ticks brought another one.
    """
    begin = now = clock.tick()
    states: list[RobotState] = []
    ticks = 0
    while now - begin < seconds:
        state, wrong = sound_robot(robot.read(), qd_max)
        if state is None:
            raise RobotError(f"The robot's state cannot be used ({wrong}): check the connection to the arm.")
        if not states or state.stamp > states[-1].stamp:
            states.append(state)
        on_tick(now)
        ticks, now = ticks + 1, clock.tick()
    if 2 * len(states) < ticks or not states:
        raise RobotError(
            f"The robot sent {len(states)} states in {ticks} ticks of the control loop: check the network, and make it"
            " report at least once per control period."
        )
    return _standstill(states)


def _standstill(states: list[RobotState]) -> Standstill:
    none = np.full(6, np.nan)
    return Standstill(
        stamp=np.array([s.stamp for s in states]),
        q=np.array([s.q for s in states]),
        qd=np.array([s.qd for s in states]),
        tau_ext=np.array([np.asarray(s.tau_ext, dtype=np.float64) for s in states]),
        wrench=np.array([none if s.wrench is None else s.wrench for s in states]),
        newest=states[-1],
    )
