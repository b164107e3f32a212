"""Steps of the controller under wild commanders, on an arm that does exactly as it is commanded, among moving balls."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from pretouch.atomic_write import write_json
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.desired import Desired
from pretouch.loop import Options, turn
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, Mode, RangeReadings, RangeStatus, RobotState
from pretouch_lab.benchmarks.avoidance.obstacle import Ball
from pretouch_lab.benchmarks.avoidance.setting import arm, skin
from pretouch_lab.benchmarks.shield.commanders import AtPerson, Commander, Extremes, Noise, Nonsense, Situation
from pretouch_lab.benchmarks.shield.filters import FILTERS
from pretouch_lab.benchmarks.shield.measures import asked_velocity, breaks_limits
from pretouch_lab.rows import Row

WILD: dict[str, Callable[[np.random.Generator], Commander]] = {
    "noise": Noise,
    "extremes": Extremes,
    "nonsense": Nonsense,
    "at-person": AtPerson,
}
"""Commanders of this part."""
_BALLS, _RADIUS_M, _CENTER, _REACH_M = 3, 0.1, np.array([0.3, 0.0, 0.5]), 0.9
_SPEED_M_S, _MEMORY_S = 0.8, 1.0
"""Speed (rms along an axis) of a ball, and how long it keeps it: an Ornstein-Uhlenbeck process."""
_READING_S, _NOISE_M, _FARTHEST_M = 0.02, 0.005, 1.3
_TORQUE_NOISE_NM, _PUSH_N, _PUSH_S, _PUSHES_S = 0.1, 40.0, 0.3, 10.0
"""What the observer says: noise, and now and then a push at the hand: its size (rms along an axis), time, and how often
on average."""
_RESUMED = 0.02
"""Share of the steps in which a person asks to go on after a latched hold."""


class World:
    """An ideal arm, which is the port `Robot`, and its skin among moving balls, which is `Skin` as `units`."""

    def __init__(self, model: RobotModel, units: Skin, period: float, rng: np.random.Generator) -> None:
        self.model, self._skin, self._period, self._rng = model, units, period, rng
        self.q, self.qd, self.now = model.description.q_ready.copy(), np.zeros(model.n), 0.0
        self.kin: Kinematics = model.kinematics(self.q)
        self._ball, self._velocity = _CENTER + rng.uniform(-1.0, 1.0, (_BALLS, 3)), np.zeros((_BALLS, 3))
        self._force, self._pushed_until = np.zeros(3), 0.0
        self._readings = self._measured()

    def advance(self) -> float:
        """Let a period pass; return the time [s]."""
        dt, rng = self._period, self._rng
        self.now += dt
        self.q = self.q + self.qd * dt
        self.kin = self.model.kinematics(self.q)
        keep = np.exp(-dt / _MEMORY_S)
        drawn = _SPEED_M_S * np.sqrt(1.0 - keep**2) * rng.normal(size=(_BALLS, 3))
        self._velocity = keep * self._velocity + drawn
        out = np.linalg.norm(self._ball - _CENTER, axis=1) > _REACH_M
        self._velocity[out] = _SPEED_M_S * (_CENTER - self._ball[out]) / _REACH_M
        self._ball = self._ball + self._velocity * dt
        if self.now > self._pushed_until:
            self._force = np.zeros(3)
            if rng.random() < dt / _PUSHES_S:
                self._force, self._pushed_until = _PUSH_N * rng.normal(size=3), self.now + _PUSH_S
        if self.now - self._readings.stamp[0] > _READING_S - 0.5 * dt:
            self._readings = self._measured()
        return self.now

    def read(self) -> RobotState:
        """See `Robot`."""
        tau = self.model.ee_jacobian(self.kin)[:3].T @ self._force
        tau = tau + _TORQUE_NOISE_NM * self._rng.normal(size=self.model.n)
        wrench = np.concatenate([self._force, np.zeros(3)]) + 0.3 * self._rng.normal(size=6)
        return RobotState(self.now, self.q, self.qd, self.q, self.qd, tau, wrench)

    def command(self, qd: FloatArray) -> None:
        """See `Robot`; what is no command is none."""
        self.qd = np.where(np.isfinite(qd), qd, 0.0)

    def situation(self) -> Situation:
        """What the commander knows: of the balls, that which is nearest to the hand."""
        k = int(np.linalg.norm(self._ball - self.kin.position[self.model.ee], axis=1).argmin())
        ball = Ball(self._ball[k], _RADIUS_M)
        return Situation(self.now, self.model, self.kin, ball, ball.center, self._velocity[k])

    @property
    def units(self) -> "Units":
        """The skin."""
        return Units(self)

    def readings(self) -> RangeReadings:
        """Return the newest readings."""
        return self._readings

    def _measured(self) -> RangeReadings:
        """Measure with every unit: the nearest ball in its cone."""
        link, T, kin = self._skin.link, self._skin.T_link_sensor, self.kin
        R = kin.rotation[link]
        origin = kin.position[link] + np.einsum("kij,kj->ki", R, T[:, :3, 3])
        beam = np.einsum("kij,kj->ki", R, T[:, :3, 2])
        to = self._ball[None] - origin[:, None]
        far = np.maximum(np.linalg.norm(to, axis=2), _RADIUS_M)
        aside = np.arccos(np.clip(np.einsum("kbi,ki->kb", to, beam) / far, -1.0, 1.0))
        seen = aside < 0.5 * PAPER_SENSOR.angle + np.arcsin(_RADIUS_M / far)
        distance = np.where(seen, far - _RADIUS_M, np.inf).min(axis=1)
        distance = np.maximum(distance + _NOISE_M * self._rng.normal(size=len(link)), 0.0)
        status = np.where(distance < _FARTHEST_M, int(RangeStatus.OK), int(RangeStatus.SIGNAL))
        return RangeReadings(np.full(len(link), self.now), np.minimum(distance, _FARTHEST_M), status)


class Units:
    """The port `Skin` of a `World`."""

    def __init__(self, world: World) -> None:
        self.read = world.readings


def play_wild(filter_name: str, commander: str, seed: int, steps: int) -> Row:
    """Turn the controller so often, as `loop.run` does, and count what must not be."""
    rng = np.random.default_rng([seed, list(WILD).index(commander)])
    model, units, profile = arm(), skin("dense"), FILTERS[filter_name]
    controller = Controller(model, units, no_fixtures(), Circle(), profile)
    return _Count(controller, World(model, units, controller.limits.period, rng), WILD[commander](rng)).over(steps, rng)


class _Count:
    """Counts what must not be."""

    def __init__(self, controller: Controller, world: World, commander: Commander) -> None:
        self._controller, self._world, self._commander = controller, world, commander
        self._asked: Desired | None = None
        self._row: Row = dict.fromkeys(("exceptions", "non_finite", "limit_violations", "moving", "contacts"), 0)
        self._first, self._changed = "", [0.0, 0]

    def over(self, steps: int, rng: np.random.Generator) -> Row:
        world, controller = self._world, self._controller
        options = Options(resume=lambda: bool(rng.random() < _RESUMED), desired=self._ask)
        state = controller.init(world.read())
        for _ in range(steps):
            before, now = world.qd, world.advance()
            try:
                cycle = turn(controller, state, world, world.units, now, options)
            except Exception as error:  # that there is none is what is measured
                self._row["exceptions"] += 1
                self._first = self._first or repr(error)
                world.command(before)
                state = controller.init(world.read())
                continue
            state = cycle.after
            self._judge(before, cycle.step.command)
            self._row["contacts"] += cycle.step.contact is not None and cycle.step.mode is Mode.REACT
        square, count = self._changed
        return self._row | {"steps": steps, "first_exception": self._first, "change_m2_s2": square, "changes": count}

    def _ask(self) -> Desired | None:
        self._asked = self._commander(self._world.situation())
        return self._asked

    def _judge(self, before: FloatArray, command: FloatArray) -> None:
        world = self._world
        if not np.isfinite(command).all():
            self._row["non_finite"] += 1
            return
        limits = self._controller.limits
        self._row["limit_violations"] += breaks_limits(world.q + command * limits.period, before, command, limits)
        self._row["moving"] += bool(np.abs(command).max() > 0.01)
        asked = asked_velocity(self._asked, world.now, world.model, world.kin)
        if asked is not None:
            got = world.model.ee_jacobian(world.kin)[:3] @ command
            self._changed[0] += float((got - asked) @ (got - asked))
            self._changed[1] += 1


def keep_wild(filter_name: str, commander: str, seed: int, steps: int, file: Path) -> None:
    """Play, and write the row to a file."""
    row = play_wild(filter_name, commander, seed, steps)
    write_json({"part": "wild", "filter": filter_name, "commander": commander, "seed": seed, **row}, file)
