"""The loop at 1 kHz with samples that come late or not at all: nothing raises, and the commands keep the limits."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from pretouch import loop
from pretouch.loop import Cycle
from pretouch.profiles import PROFILES, at_rate
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode, RangeReadings, RobotState
from tests import test_loop
from tests.following_arm import controller_of

DT = 0.001
PAPER = PROFILES["paper"]
# hard accelerations, so that they are at their limits often; a short window, so that the arm soon moves
BRISK = replace(
    PAPER, task=replace(PAPER.task, acceleration_m_s2=50.0, speed_m_s=0.8), window=replace(PAPER.window, samples=20)
)


class World(test_loop.World):
    """An arm that does as it is told, whose state is read with a delay and sometimes not anew, its skin and clock."""

    period = DT

    def __init__(self, model: RobotModel, units: int, lost: float = 0.0, delay: int = 0) -> None:
        super().__init__(model, units)
        self.lost, self.rng = lost, np.random.default_rng(0)
        self.states: deque[RobotState] = deque(maxlen=delay + 1)
        self.been: list[np.ndarray] = []
        self.steps: list[ControlStep] = []
        self.silent = np.inf, np.inf

    def tick(self) -> float:
        super().tick()
        self.been.append(self.q)
        return self.now

    def read(self) -> RobotState:
        if not self.states or self.rng.uniform() >= self.lost:
            wrench = np.concatenate([self.rng.normal(0.0, 0.3, 3), np.zeros(3)])
            self.states.append(replace(super().read(), wrench=wrench))
        return self.states[0]

    def record(self, cycle: Cycle) -> None:
        self.steps.append(cycle.step)


class SilentFor(test_loop.FakeSkin):
    """A skin that sees nothing, and stops in the times of its world."""

    def read(self) -> RangeReadings:
        readings, (begin, end) = super().read(), self.world.silent
        return replace(readings, stamp=np.minimum(readings.stamp, begin)) if self.world.now < end else readings


def turn(model: RobotModel, skin: Skin, world: World, seconds: float) -> list[Mode]:
    controller = controller_of(model, skin, at_rate(BRISK, 1 / DT))
    loop.run(controller, world, SilentFor(world), world, world, lambda step: world.now >= seconds)
    return [step.mode for step in world.steps]


def assert_within_limits(model: RobotModel, world: World) -> None:
    world.tick()
    arm, sent = model.description, np.array(world.held)
    assert np.all(np.isfinite(sent))
    assert np.all(np.abs(sent) <= arm.qd_max + 1e-9)
    assert np.all(np.abs(np.diff(sent, axis=0)) <= arm.qdd_max * DT * (1 + 1e-9))
    assert np.all((world.been >= model.q_min) & (world.been <= model.q_max))
    np.testing.assert_array_equal(sent[-1], 0.0)


@pytest.mark.parametrize(("lost", "delay"), [(0.01, 0), (0.3, 0), (0.0, 1), (0.0, 20)])
def test_lost_and_late_states_keep_the_arm_going_within_its_limits(panda_model, paper_skin, lost: float, delay: int):
    world = World(panda_model, len(paper_skin), lost, delay)
    modes = turn(panda_model, paper_skin, world, 2.0)
    assert set(modes[300:]) == {Mode.TRACK}
    assert np.abs(world.held).max() > 0.5
    assert_within_limits(panda_model, world)


@pytest.mark.parametrize("delay", [0, 20])
def test_a_skin_that_stops_stops_the_arm_until_it_is_heard_again(panda_model: RobotModel, paper_skin: Skin, delay: int):
    world = World(panda_model, len(paper_skin), lost=0.01, delay=delay)
    world.silent = 0.6, 1.5
    modes = turn(panda_model, paper_skin, world, 2.0)
    at = np.array([step.stamp for step in world.steps])
    # held 0.3 s after the last reading, and at rest no later than from full speed
    assert {mode for mode, t in zip(modes, at, strict=True) if 0.91 < t < 1.49} == {Mode.HOLD}
    speeds = np.abs([step.command for step in world.steps]).max(axis=1)
    assert np.all(speeds[(at > 1.25) & (at < 1.49)] == 0.0)
    assert modes[-1] is Mode.TRACK
    assert speeds[-1] > 0
    assert_within_limits(panda_model, world)
