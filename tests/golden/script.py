"""An arm and its units by script: what they report does not depend on what the controller commands.

All numbers come of plain arithmetic on constants and seeded draws and are rounded, so that every processor makes the
same: what the last bit of a command is cannot come back as an input.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.types import Inputs, RangeReadings, RangeStatus, RobotState, SeenPoints, TouchReadings

DT = 0.01
READY = (0.0, -0.785398163, 0.0, -2.35619449, 0.0, 1.570796327, 0.785398163)
Change = Callable[[Inputs], Inputs]


class Script:
    """What an arm, its units and outside sources say in each of T cycles. Rows of its arrays are cycles."""

    def __init__(self, cycles: int, units: int = 7, start: tuple[float, ...] = READY, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.rng = rng
        self.time = DT * np.arange(cycles)
        self.q, self.qd = np.tile(np.array(start), (cycles, 1)), np.zeros((cycles, 7))
        self.force = 0.5 * rng.uniform(-1, 1, (cycles, 3))
        self.torque = 0.1 * rng.uniform(-1, 1, (cycles, 7))
        self.distance = np.zeros((cycles, units))
        self.status = np.full((cycles, units), int(RangeStatus.SIGNAL))
        self.stamp = np.tile(self.time[:, None], (1, units))
        self.contact, self.touch_force = np.zeros((cycles, units), bool), np.full((cycles, units), 2.0)
        self.points: dict[int, np.ndarray] = {}
        self.touches = False
        self.changes: dict[int, list[Change]] = {}

    def move(self, begin: int, end: int, way: dict[int, float]) -> None:
        """Turn some joints by an angle [rad], smoothly, from one cycle to another; they stay there."""
        s = np.clip((np.arange(len(self.time)) - begin) / (end - begin), 0.0, 1.0)
        for joint, angle in way.items():
            self.q[:, joint] += angle * s * s * (3.0 - 2.0 * s)
            self.qd[:, joint] += angle * 6.0 * s * (1.0 - s) / ((end - begin) * DT)

    def see(self, unit: int, begin: int, end: int, first: float, last: float) -> None:
        """Let a unit see something that comes from one distance to another [m]."""
        count = end - begin
        self.distance[begin:end, unit] = first + (last - first) * np.arange(count) / count
        self.status[begin:end, unit] = int(RangeStatus.OK)

    def push(self, model: RobotModel, begin: int, end: int, link: str, force: tuple[float, float, float]) -> None:
        """Push at the origin of a link [N]: its joints feel it, and the force estimate says it."""
        k = model.link_index(link)
        for i in range(begin, end):
            kin = model.kinematics(self.q[i])
            self.torque[i] += np.round(model.jacobian(kin, k, kin.position[k])[:3].T @ np.array(force), 6)
            self.force[i] += force

    def change(self, begin: int, end: int, change: Change) -> None:
        """Change what is given in some cycles."""
        for i in range(begin, end):
            self.changes.setdefault(i, []).append(change)

    def resume(self, *cycles: int) -> None:
        """Let a person ask to go on."""
        for i in cycles:
            self.change(i, i + 1, lambda inputs: replace(inputs, resume=True))

    def state(self, i: int) -> RobotState:
        """What the arm reports in a cycle."""
        q, qd, torque, force = (np.round(a[i], 9) for a in (self.q, self.qd, self.torque, self.force))
        return RobotState(self._now(i), q.copy(), qd.copy(), q, qd, torque, np.concatenate((force, np.zeros(3))))

    def inputs(self, i: int) -> Inputs:
        """All that the controller is given in a cycle."""
        stamp = np.round(self.stamp[i], 9)
        given = Inputs(
            self._now(i),
            self.state(i),
            RangeReadings(stamp, np.round(self.distance[i], 9), self.status[i].astype(np.int64)),
            touch=self._touch(i, stamp),
            points=self._points(i),
        )
        for change in self.changes.get(i, ()):
            given = change(given)
        return given

    def _now(self, i: int) -> float:
        return round(float(self.time[i]), 9)

    def _touch(self, i: int, stamp: np.ndarray) -> TouchReadings | None:
        if not self.touches:
            return None
        return TouchReadings(
            stamp.copy(), self.contact[i].copy(), self.touch_force[i].copy(), np.zeros(len(stamp), int)
        )

    def _points(self, i: int) -> SeenPoints | None:
        if i not in self.points:
            return None
        point = np.round(self.points[i], 9)
        return SeenPoints(self._now(i), np.full(len(point), self._now(i)), point, np.full(len(point), 0.005))
