"""Following a plan, on the simulated arm and on one that does exactly what it is told."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pretouch.calibration.motion.perform import Performance, PerformParams, perform
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.types import RobotState

DT = 0.01
PARAMS = PerformParams()


def plan_for(model: RobotModel) -> Plan:
    """Stand, go, swing and come back, in seven seconds."""
    q = model.description.q_ready
    away = q + np.array([0.4, 0.2, -0.3, 0.2, 0.5, 0.3, -0.6])
    tones = np.linspace(0.4, 1.0, 14).reshape(2, 7)
    swing = Swing(2.0, 3.5, 1.0, 0.4 / (2 * np.pi * tones), tones, tones)
    return Plan(np.array([0.0, 0.5, 2.0, 5.5, 7.0]), np.array([q, q, away, away, q]), (swing,))


class Arm:
    """Moves as commanded, tells the truth unless asked otherwise, and is its own clock."""

    def __init__(self, model: RobotModel) -> None:
        self.model, self.now = model, 5.0
        self.q, self.qd = model.description.q_ready.copy(), np.zeros(7)
        self.tell: Callable[[RobotState], RobotState] = lambda state: state
        self.commands: list[np.ndarray] = []

    def tick(self) -> float:
        self.now += DT
        self.q = self.q + self.qd * DT
        return self.now

    def read(self) -> RobotState:
        return self.tell(RobotState(self.now, self.q, self.qd, self.q, self.qd, np.zeros(7), None))

    def command(self, qd: np.ndarray) -> None:
        self.qd = qd
        self.commands.append(qd)

    def assert_rested_within_limits(self) -> None:
        np.testing.assert_array_equal(self.qd, 0.0)
        steps = np.abs(np.diff([np.zeros(7), *self.commands], axis=0))
        assert np.all(steps <= self.model.description.qdd_max * DT * (1 + 1e-9))


@pytest.fixture
def arm(panda_model: RobotModel) -> Arm:
    return Arm(panda_model)


def done_with(arm: Arm, tell: Callable[[RobotState], RobotState], after: float = 3.0) -> Performance:
    """Perform with an arm that tells something else from some time on."""
    begin = arm.now
    arm.tell = lambda state: tell(state) if state.stamp - begin > after else state
    return perform(arm, arm, arm.model, plan_for(arm.model), PARAMS)


@pytest.mark.parametrize("seed", [0, 1])
def test_the_simulated_arm_follows_within_four_milliradians(panda_model: RobotModel, seed: int):
    plan, ticks = plan_for(panda_model), []
    plant = Plant(panda_model, SceneSpec(), PlantParams(), plan.start, seed)
    done = perform(plant, PlantClock(plant, DT), panda_model, plan, PARAMS, ticks.append)
    assert done.stopped is None
    trace = done.joints
    assert len(trace.stamp) == len(ticks) == pytest.approx(plan.duration / DT, abs=1)
    np.testing.assert_allclose(np.diff(trace.stamp), DT, atol=1e-9)
    off = [q - plan.at(stamp - done.begin)[0] for stamp, q in zip(trace.stamp, trace.q, strict=True)]
    assert np.abs(off).max() < 4e-3
    plant.advance(0.3)
    np.testing.assert_allclose(plant.read().q, plan.end, atol=2e-3)


def test_an_arm_without_faults_ends_where_it_began_and_at_rest(arm: Arm):
    done = perform(arm, arm, arm.model, plan_for(arm.model))
    assert done.stopped is None
    np.testing.assert_allclose(arm.q, arm.model.description.q_ready, atol=1e-4)
    arm.assert_rested_within_limits()


def test_a_push_stops_the_simulated_arm(panda_model: RobotModel):
    plan = plan_for(panda_model)
    plant = Plant(panda_model, SceneSpec(), PlantParams(), plan.start, 0)
    hand = panda_model.link_index("panda_hand")

    def push(time: float) -> None:
        plant.mj_data.xfrc_applied[hand, :3] = [0.0, 40.0, 0.0] if time > 2.5 else 0.0

    plant.before_each_step(push)
    done = perform(plant, PlantClock(plant, DT), panda_model, plan)
    assert done.stopped is not None
    assert "was pushed with" in done.stopped
    assert 2.5 < done.joints.stamp[-1] < 2.8
    plant.mj_data.xfrc_applied[:] = 0.0
    plant.advance(0.5)
    assert np.abs(plant.read().qd_commanded).max() == 0.0


@pytest.mark.parametrize(
    ("tell", "words"),
    [
        (lambda s: replace(s, stamp=s.stamp - 0.5), r"newest state is 0.500 s old"),
        (lambda s: replace(s, q=s.q + 0.2 * np.eye(7)[3]), r"joint4 strayed 0.2\d\d rad from the plan"),
        (lambda s: replace(s, q=s.q * np.nan), "state cannot be used: joint positions hold nan"),
        (lambda s: replace(s, tau_ext=-20.0 * np.eye(7)[1]), r"joint2 was pushed with -20.0 Nm"),
        (lambda s: replace(s, tau_ext=s.tau_ext * np.nan), r"was pushed with nan Nm"),
        (lambda s: None, "state cannot be used: it is None"),
    ],
    ids=["stale", "strayed", "nan", "pushed", "no torques", "none"],
)
def test_what_is_not_as_planned_stops_the_arm_and_what_was_measured_is_kept(arm: Arm, tell, words: str):
    done = done_with(arm, tell)
    assert done.stopped is not None
    assert re.search(words, done.stopped)
    assert len(done.joints.stamp) == pytest.approx(300, abs=2)
    arm.assert_rested_within_limits()


def test_a_state_that_no_longer_changes_stops_it(arm: Arm):
    last = arm.read()
    done = done_with(arm, lambda state: replace(last, stamp=8.0, q=state.q))
    assert done.stopped is not None
    assert "check the connection" in done.stopped
    arm.assert_rested_within_limits()


def test_an_exception_while_the_units_are_read_stops_it(arm: Arm):
    def fail(tick: float) -> None:
        if tick > 7.0:
            raise OSError("the network is gone")

    done = perform(arm, arm, arm.model, plan_for(arm.model), PARAMS, fail)
    assert done.stopped == "OSError: the network is gone"
    assert len(done.joints.stamp) > 100
    arm.assert_rested_within_limits()


def test_ctrl_c_brings_it_to_rest_first(arm: Arm):
    def interrupt(tick: float) -> None:
        if tick > 7.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        perform(arm, arm, arm.model, plan_for(arm.model), PARAMS, interrupt)
    arm.assert_rested_within_limits()


@pytest.mark.parametrize(
    ("tell", "words"),
    [
        (lambda s: replace(s, q=s.q + 0.1 * np.eye(7)[5]), "joint6 is 0.100 rad off, .* move the arm there first"),
        (lambda s: replace(s, qd_commanded=np.full(7, 0.1)), "is moving"),
        (lambda s: replace(s, q=s.q[:3]), "state cannot be used"),
    ],
)
def test_an_arm_that_is_not_ready_is_sent_nothing(arm: Arm, tell, words: str):
    arm.tell = tell
    with pytest.raises(CalibrationError, match=words):
        perform(arm, arm, arm.model, plan_for(arm.model))
    assert arm.commands == []
