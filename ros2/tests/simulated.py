"""Our commands and a joint_trajectory_controller in simulated time: what the arm is asked for, to the last bit."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from ros2.tests.spline import Release, Spline

from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch_ros2.joints import Measured
from pretouch_ros2.messages import Messages
from pretouch_ros2.params import ArmParams
from pretouch_ros2.trajectory_commands import TrajectoryCommands, parts_of_day

MODEL = RobotModel(panda())
A, V = MODEL.description.qdd_max, MODEL.description.qd_max
MESSAGES = Messages("jazzy")
PERIOD = 0.01
SETTLED = 1.0
"""When a course begins [s]."""


def swing(time: float) -> np.ndarray:
    """Velocities of 0.8 rad/s that turn around, each joint at another time."""
    return 0.8 * np.sin(2.0 * time + np.arange(7)) * min(1.0, time)


class TrajectoryRun:
    """Drives a simulated controller; `asked` has the positions at each of its periods."""

    def __init__(self, release: Release, rate: float, params: ArmParams | None = None, lag: float = 0.0) -> None:
        self.sent: list[Any] = []
        publisher = SimpleNamespace(publish=self.sent.append)
        node: Any = SimpleNamespace(messages=MESSAGES, publisher=lambda *_: publisher)
        self.params = params or ArmParams("on-robot", "base")
        names = list(MODEL.joints)
        self.commands = TrajectoryCommands(self.params, MODEL, names, node, PERIOD)
        self.controller = Spline(release, 1 / rate, names, MODEL.description.q_ready)
        self.rate, self.lag, self.tripped = rate, lag, ""
        self.wish_from, self.messages = SETTLED, 0
        self.asked: list[np.ndarray] = []
        self.times: list[float] = []

    def run(
        self,
        wish: Callable[[float], np.ndarray],
        until: float,
        late: Callable[[int], float] = lambda k: 1e-3,
        lost: Callable[[float], bool] = lambda t: False,
        off: tuple[float, float, np.ndarray | None] = (np.inf, np.inf, None),
        skew: float = 0.0,
    ) -> "TrajectoryRun":
        """Turn both.

        Args:
            wish: velocities (7,) [rad/s] by the time since `SETTLED` [s].
            until: end [s].
            late: time from a turn until its message is there, by its number [s].
            lost: whether what is sent at an instant does not arrive.
            off: while the controller is switched off, and where the arm is put meanwhile.
            skew: how far the controller's clock is ahead [s].
        """
        day = np.subtract(*[sec + ns / 1e9 for sec, ns in (parts_of_day(0.0), (0, 0))])
        mail: list[tuple[float, Any]] = []
        qd, turn, q = np.zeros(7), 0, MODEL.description.q_ready
        for now in np.arange(0.0, until, 1 / self.rate) + 0.3 / self.rate:
            measured = self._measured(now)
            while (begin := turn * PERIOD) <= now and not self.tripped:
                self._tick(begin, wish, qd := self._next(qd, wish, begin), measured)
                if not lost(begin):
                    mail += [(begin + late(turn), message) for message in self.sent]
                self.messages += len(self.sent)
                self.sent.clear()
                turn += 1
            mail.sort(key=lambda each: each[0])
            is_off = off[0] <= now < off[1]
            while mail and mail[0][0] <= now:
                message = mail.pop(0)[1]
                if not is_off:
                    self.controller.take(message, day + skew)
            if is_off:
                q = off[2] if off[2] is not None else self.asked[-1]
                self.controller.restart(q)
            else:
                q = self.controller.update(now)
            self.asked.append(np.array(q))
            self.times.append(now)
        return self

    def _next(self, qd: np.ndarray, wish: Callable[[float], np.ndarray], now: float) -> np.ndarray:
        wanted = wish(now - SETTLED) if now >= self.wish_from else np.zeros(7)
        return qd + np.clip(wanted - qd, -A * PERIOD * 0.9, A * PERIOD * 0.9)

    def _measured(self, now: float) -> np.ndarray:
        back = round(self.lag * self.rate) + 1
        return self.asked[-back] if len(self.asked) >= back else MODEL.description.q_ready

    def _tick(self, now: float, wish: Any, qd: np.ndarray, q: np.ndarray) -> None:
        joints = Measured(now, q, np.zeros(7))
        if not self.commands.begun:
            self.commands.begin(joints, now)
        try:
            self.commands.check(joints, now)
        except Exception as error:
            self.tripped = str(error)
            return
        self.commands.send(qd, now)

    def speed(self) -> np.ndarray:
        """Velocities between the positions asked for [rad/s]."""
        return np.diff(np.array(self.asked), axis=0) * self.rate

    def acceleration(self, begin: float = 0.0, end: float = np.inf) -> float:
        """Largest acceleration from the positions asked for, in limits."""
        found = np.abs(np.diff(self.speed(), axis=0) * self.rate / A).max(axis=1)
        time = np.array(self.times)[2:]
        return float(found[(time >= begin) & (time < end)].max())
