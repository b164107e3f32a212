"""An arm that reports what is not so, in finite numbers: no lie moves it faster than its acceleration limits allow."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pretouch import loop
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode, RobotState
from tests.test_loop import DT, World

Lie = Callable[[RobotState], RobotState]


class Liar(World):
    """An arm that follows its commands, and reports something else."""

    lie: Lie = staticmethod(lambda robot: robot)

    def read(self) -> RobotState:
        return self.lie(super().read())


def controller(model: RobotModel, name: str) -> Controller:
    return Controller(model, Skin([], model), no_fixtures(), Circle(), profile(name))


def turned(control: Controller, arm: Liar, steps: int) -> list[ControlStep]:
    state, said = control.init(arm.read()), []
    for step in range(2 * steps):
        if step == steps:
            arm.lie = arm.told
        cycle = loop.turn(control, state, arm, arm.skin(), arm.tick())
        state = cycle.after
        said.append(cycle.step)
    return said


@pytest.fixture
def arm(panda_model: RobotModel) -> Liar:
    return Liar(panda_model, 0)


@pytest.mark.parametrize("speed", [1.0, -0.5, 0.2])
def test_a_standing_arm_that_is_told_it_moves_stays_where_it_is_and_says_why(panda_model, arm, speed):
    arm.told = lambda robot: replace(robot, qd_commanded=np.full(7, speed))
    control = controller(panda_model, "paper:task.speed_m_s=1e-6")
    said = turned(control, arm, 20)
    assert max(np.abs(step.command).max() for step in said) < 1e-6
    assert said[-1].mode is Mode.HOLD
    assert "commanded joint velocities hold nan" in said[-1].reason


class Shaker(Liar):
    """Reports, of the commands of late, always the one that is farthest from the last."""

    def __init__(self, model, seed):
        super().__init__(model, seed)
        self.commands = []

    def command(self, qd):
        self.commands = [*self.commands[-5:], qd.copy()]
        super().command(qd)

    def told(self, robot):
        if not self.commands:
            return robot
        kept = np.array(self.commands)
        far = np.abs(kept - kept[-1]).argmax(axis=0)
        return replace(robot, qd_commanded=kept[far, np.arange(7)], stamp=robot.stamp + 1e-4)


@pytest.mark.parametrize("name", ["paper", "paper:task.speed_m_s=0.5", "pretouch"])
def test_reports_of_old_commands_do_not_shake_the_arm(panda_model, name):
    arm = Shaker(panda_model, 0)
    said = turned(controller(panda_model, name), arm, 150)
    change = np.abs(np.diff([step.command for step in said], axis=0)).max(axis=0)
    assert (change <= 5.0 * panda_model.description.qdd_max * DT).all()


def test_states_that_waited_together_are_no_jump(panda_model, arm):
    """Stamps may be times of arrival: after 40 ms without any, a state of then comes at once with the newest."""
    control = controller(panda_model, "paper:task.speed_m_s=0.5")
    state, held, kept = control.init(arm.read()), [], []
    for step in range(400):
        kept.append(World.read(arm))
        late = step % 50 in (10, 11, 12, 13)
        first = kept[-1 - step % 50 + 9] if late else kept[-1]
        if step % 50 == 13:
            first = replace(kept[-4], stamp=kept[-1].stamp)
        arm.lie = lambda _, first=first: first
        cycle = loop.turn(control, state, arm, arm.skin(), arm.tick())
        state = cycle.after
        held.append(cycle.step.reason if cycle.step.mode is Mode.HOLD else "")
    assert "nan" not in "".join(held)


@pytest.mark.parametrize(("step_rad", "held"), [(0.5, True), (-0.08, True), (0.01, False)])
def test_an_encoder_that_jumps_makes_the_arm_hold_until_a_person_has_looked(panda_model, arm, step_rad, held):
    arm.told = lambda robot: replace(robot, q=robot.q + step_rad * (np.arange(7) == 3))
    said = turned(controller(panda_model, "paper"), arm, 150)
    assert all(step.mode is not Mode.HOLD for step in said[120:150])
    assert (said[150].mode is Mode.HOLD) is held
    assert (said[-1].mode is Mode.HOLD) is held
    assert ("joint positions hold nan" in said[150].reason) is held


@pytest.mark.parametrize("name", ["paper", "pretouch"])
@pytest.mark.parametrize("field", ["stamp", "q", "qd", "q_commanded", "qd_commanded", "tau_ext", "wrench"])
def test_no_finite_lie_breaks_the_acceleration_limits_by_more_than_once_their_size(panda_model, arm, field, name):
    rng = np.random.default_rng(7)
    size = {
        "stamp": 0.03,
        "q": 1.0,
        "qd": 1.0,
        "q_commanded": 1.0,
        "qd_commanded": 1.5,
        "tau_ext": 50.0,
        "wrench": 80.0,
    }

    def told(robot: RobotState) -> RobotState:
        if rng.random() < 0.3:  # sometimes it says the truth
            return robot
        honest = np.asarray(getattr(robot, field))
        lie = honest + size[field] * rng.choice([0.001, 0.03, 1.0]) * rng.uniform(-1, 1, honest.shape)
        return replace(robot, **{field: float(lie) if field == "stamp" else lie})

    arm.told = told
    turned(controller(panda_model, name), arm, 80)
    changes = np.abs(np.diff(arm.held, axis=0)) / (panda_model.description.qdd_max * DT)
    assert changes[:80].max() <= 1 + 1e-9
    assert changes.max() <= 2 + 1e-3  # one by which a report may differ, and one from there


def test_what_the_commands_of_late_explain_is_believed_as_it_is(panda_model, arm):
    control = controller(panda_model, "paper")
    robot, state = arm.read(), control.init(arm.read())
    state.watch.sent, state.watch.stamp = tuple((0.01 * k, np.full(7, 0.1 * k)) for k in range(4)), 0.03
    state.command = np.full(7, 0.4)

    def believed(qd: np.ndarray, now: float = 0.04) -> np.ndarray:
        return loop.explained(control, state, replace(robot, qd_commanded=qd), now).qd_commanded

    step = control.limits.qdd_max * DT
    for honest in (np.full(7, 0.4), np.zeros(7), np.linspace(0, 0.4, 7), 0.4 + step, -step):
        np.testing.assert_array_equal(believed(honest), honest)
    np.testing.assert_array_equal(np.isnan(believed(0.4 + 1.1 * step * np.eye(7)[2])), np.eye(7)[2] == 1)
    # a loop that was late finds an arm that has braked in the meantime
    np.testing.assert_array_equal(believed(-4.9 * step, now=0.08), -4.9 * step)


@pytest.mark.parametrize("report", [None, "no arm", 3.0])
def test_what_is_no_report_is_left_for_the_step_to_name(panda_model, arm, report):
    control = controller(panda_model, "paper")
    assert loop.explained(control, control.init(arm.read()), report, 0.0) is report
