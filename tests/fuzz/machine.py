"""Drives controllers of many worlds through all weathers, with an arm that follows commands exactly."""

from collections import Counter
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np

from pretouch.controller import Controller, ControllerState
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.types import ControlStep, Inputs, QpOutcome, RobotState
from tests.fuzz import invariants, weather
from tests.fuzz.worlds import World, any_world
from tests.reference.modes import Trust

DEEP = 10
"""Each so many steps the dear checks are made: shapes, inputs untouched, the same again."""


@cache
def _models(_use: str) -> tuple[RobotModel, RobotModel]:
    """Read the arms once for each use."""
    return RobotModel(panda()), RobotModel(fr3())


class Machine:
    """One seed: worlds, one after the other, and what was reached in them."""

    def __init__(self, seed: int, lies: list[float] = weather.LIES) -> None:
        self.rng = np.random.default_rng(seed)
        self.models = _models("checked")
        # the checks' own, apart from the scratch memory of those that are checked
        self.others = dict(zip(("panda", "fr3"), _models("checking"), strict=True))
        self.lies = lies
        self.reached: Counter[str] = Counter()
        self.given: tuple[object, ...] = ()

    def run(self, steps: int, each: int = 250) -> Counter[str]:
        """Run so many steps, `each` in one world, and count what was reached. What fails is told with its place."""
        for begun in range(0, steps, each):
            try:
                Course(self, any_world(self.rng, self.models[begun // each % 2])).run(min(each, steps - begun))
            except Exception as error:
                error.add_note(f"In the world begun at step {begun}: {self.given}")
                raise
        return self.reached


class Course:
    """One arm in one world."""

    def __init__(self, machine: Machine, world: World) -> None:
        self.machine, self.world, self.rng = machine, world, machine.rng
        self.controller = Controller(world.model, world.skin, world.fixtures, world.path, world.profile)
        self.other = machine.others[world.model.description.name]
        self.q, self.qd, self.time = world.q.copy(), world.qd.copy(), float(self.rng.uniform(0.0, 1e5))
        self.weather = weather.Weather(self.rng, len(world.skin))
        self.read_only = self.rng.random() < 0.3
        robot = self.robot()
        self.begin(robot)
        p = world.profile
        approach = "none" if p.approach is None else f"{p.approach.name} {getattr(p.approach, 'rows', '')}".strip()
        self.setting = (
            "step", f"arm {world.model.description.name}", f"restriction {approach}",
            f"detection {p.detect.name}", f"reaction {p.react.name}", f"period {p.task.control_period_s}",
            f"units {len(world.skin)}",
        )  # fmt: skip

    def begin(self, robot: RobotState) -> None:
        """Begin with a state of the arm; what of later ones is to be believed says the plain controller's `Trust`."""
        self.state, self.command = self.controller.init(robot), robot.qd_commanded
        self.trust = Trust(robot, self.world.profile.failure, self.world.model.description.qd_max)

    def robot(self) -> RobotState:
        """Return what the arm's interface reports: the truth, but for the measured joint positions."""
        measured = self.q + self.rng.normal(scale=self.world.measured_off, size=len(self.q))
        q, qd, wrench = self.q.copy(), self.qd.copy(), self.weather.wrench()
        return RobotState(self.time, measured, qd, q, self.qd.copy(), self.weather.torques(), wrench)

    def run(self, steps: int) -> None:
        """Let the arm be driven for so many steps."""
        for i in range(steps):
            self.weather.pass_on()
            inputs, fault = self._inputs()
            self.machine.given = (i, fault, self.weather, inputs, self.world)
            self.step(inputs, deep=i % DEEP == 0)
            self.machine.reached[f"fault {fault}"] += 1

    def _inputs(self) -> tuple[Inputs, str]:
        rng = self.rng
        fault = str(rng.choice(weather.FAULTS)) if rng.random() < 0.02 else ""
        if fault == "overrun":
            self.time += float(rng.choice([0.06, 0.6]))
        resume = bool(rng.random() < 0.1)
        inputs = Inputs(self.time, self.robot(), self.weather.readings(self.time), resume)
        if fault:
            inputs = weather.spoiled(inputs, fault, float(rng.choice(weather.NOT_FINITE)), int(rng.integers(7)))
        elif self.world.lying and rng.random() < 0.03:
            fault = str(rng.choice(weather.FAULTS[:4]))
            inputs = weather.spoiled(inputs, fault, float(rng.choice(self.machine.lies)), int(rng.integers(7)))
            fault = f"lie about {fault}"
        if self.read_only:
            for _, array in invariants.arrays_of(inputs.readings) + invariants.arrays_of(inputs.robot):
                array.flags.writeable = False
        return inputs, fault

    def step(self, inputs: Inputs, deep: bool) -> ControlStep:
        """Run one step, check all there is to check, and move the arm as commanded."""
        before, given = self.state, deepcopy((inputs, self.state)) if deep else None
        step, self.state = self.controller.step(before, inputs)
        believed, wrong = self.trust.judge(inputs, self.command, self.world.profile.task.control_period_s)
        self._check(step, believed)
        invariants.check_mode(step, before.mode, wrong, inputs.resume, self.world.profile)
        self.command = step.command.copy()
        if given is not None:
            invariants.check_shapes(step, self.world.model.n, len(self.world.skin))
            assert invariants.same(inputs, given[0]), "inputs were changed"
            self._replay(before, inputs, step)
            assert invariants.same(before, given[1]), "the state before was changed"
        self._count(step)
        self._follow(step.command)
        return step

    def _check(self, step: ControlStep, believed: RobotState) -> None:
        p, model = self.world.profile, self.other
        invariants.check_command(step, believed, p, model)
        invariants.check_finite(step, believed, p)
        invariants.check_braking(step, believed, p, model)
        invariants.check_obstacles(step, len(self.world.skin))
        invariants.check_speed_scale(step, p)
        invariants.check_rows(step, p, model)
        assert invariants.same(step.qp.qd, step.command)
        assert self.world.lying or step.qp.outcome is not QpOutcome.FAILED, step.qp.status
        assert step.stamp == self.trust.now
        assert np.array_equal(step.q, believed.q)
        assert (np.abs(step.q_commanded - believed.q_commanded) <= 1e-12 + 1e-12 * np.abs(believed.q_commanded)).all()
        assert step.latched == self.state.mode.latched

    def _replay(self, before: ControllerState, inputs: Inputs, step: ControlStep) -> None:
        """The same again, after another step in between, is the same to the last bit."""
        kept, kept_state = deepcopy((step, self.state))
        self.controller.step(self.state, replace(inputs, stamp=inputs.stamp + 0.01, resume=True))
        again, state_again = self.controller.step(before, inputs)
        assert invariants.same(again, step), "not the same again"
        assert invariants.same(state_again, kept_state), "not the same state again"
        assert invariants.same(self.state, kept_state), "the state was changed"
        assert invariants.same(step, kept), "a published step changed"

    def _count(self, step: ControlStep) -> None:
        tight = len(step.restricted) and step.qp.slack.max() > 1e-6
        self.machine.reached.update([
            *self.setting, f"mode {step.mode.name}", f"outcome {step.qp.outcome.name}", f"event {step.event.name}",
            f"sight {self.weather.sight}", f"force {self.weather.feel}", f"slack {bool(tight)}",
            f"latched {step.latched}", f"slowed {step.speed_scale < 1}",
            f"on the axis {bool((step.obstacles.body_distance < -0.04).any())}",
        ])  # fmt: skip

    def _follow(self, command: np.ndarray) -> None:
        """Move as commanded; a command no arm could follow, the answer to a lie, stops it."""
        dt = self.world.profile.task.control_period_s
        reach = self.world.model.description.qdd_max * dt
        followed = (np.abs(command - self.qd) <= reach + 1e-9).all()
        self.qd = command.copy() if followed else self.qd - np.clip(self.qd, -reach, reach)
        self.q = self.q + self.qd * dt
        self.time += dt
