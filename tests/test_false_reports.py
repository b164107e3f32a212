"""An arm that reports what is not so, in finite numbers: no lie moves it faster than its acceleration limits allow."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pretouch import loop
from pretouch.controller import Controller
from pretouch.faults import Watched, add_sent
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode, RobotState
from tests.following_arm import controller_of
from tests.test_loop import DT, World

Lie = Callable[[RobotState], RobotState]


class Liar(World):
    """An arm that follows its commands, and reports something else."""

    lie: Lie = staticmethod(lambda robot: robot)

    def read(self) -> RobotState:
        return self.lie(super().read())


class Irregular(Liar):
    """An arm whose loop is late, or whose clock is set, at some ticks; while nothing is sent it holds its velocity."""

    def __init__(self, model: RobotModel, seed: int) -> None:
        super().__init__(model, seed)
        self.late, self.set_by = 0.0, 0.0
        """Lateness of the next tick, and by how much the clock is set before it [s]."""

    def tick(self) -> float:
        self.now, self.q = self.now + self.late + self.set_by, self.q + self.qd * self.late
        self.late = self.set_by = 0.0
        return super().tick()


def controller(model: RobotModel, name: str) -> Controller:
    return controller_of(model, Skin([], model), profile(name))


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
    assert "RobotState.qd_commanded holds nan" in said[-1].reason


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


@pytest.mark.parametrize(
    ("late", "step_rad", "held"),
    [(0.0, 0.5, True), (0.0, -0.08, True), (0.0, 0.01, False), (0.1, 0.1, True), (0.3, 0.3, True)],
)
def test_an_encoder_that_jumps_makes_the_arm_hold_until_a_person_has_looked(panda_model, late, step_rad, held):
    arm, control = Irregular(panda_model, 0), controller(panda_model, "paper")
    state, said = control.init(arm.read()), []
    for step in range(300):
        if step == 150:
            arm.late, arm.lie = late, lambda robot: replace(robot, q=robot.q + step_rad * np.eye(7)[3])
        resume = loop.Options(resume=lambda step=step: step == 250)
        cycle = loop.turn(control, state, arm, arm.skin(), arm.tick(), resume)
        state = cycle.after
        said.append(cycle.step)
    modes = [step.mode for step in said]
    assert Mode.HOLD not in modes[120:150]
    assert (set(modes[150:250]) == {Mode.HOLD}) is held
    assert (Mode.HOLD in modes[150:250]) is held
    assert ("RobotState.q holds nan" in said[150].reason) is held
    assert modes[-1] is not Mode.HOLD


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


@pytest.mark.parametrize("name", ["paper", "pretouch"])
@pytest.mark.parametrize("late", [0.1, 0.5])
def test_one_false_report_after_a_late_tick_leaves_a_standing_arm_where_it_is(panda_model, late, name):
    arm, control = Irregular(panda_model, 0), controller(panda_model, f"{name}:task.speed_m_s=1e-6")
    speed = np.minimum(0.95 * control.limits.qdd_max * late, 1.9 * control.limits.qd_max)
    state = control.init(arm.read())

    def false(robot: RobotState) -> RobotState:
        return replace(robot, qd_commanded=speed)

    for step in range(100):
        arm.late, arm.lie = (late, false) if step == 20 else (0.0, Liar.lie)
        state = loop.turn(control, state, arm, arm.skin(), arm.tick()).after
    assert np.abs(np.array(arm.held) / (control.limits.qdd_max * DT)).max() <= 2 + 1e-3
    assert np.abs(arm.q - panda_model.description.q_ready).max() < 0.01


@pytest.mark.parametrize("name", ["paper", "paper:task.speed_m_s=1e-6", "pretouch"])
@settings(max_examples=6)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_lie_at_a_late_tick_or_of_a_clock_that_is_set_breaks_the_acceleration_limits(panda_model, name, seed):
    rng, arm = np.random.default_rng(seed), Irregular(panda_model, 0)
    control = controller(panda_model, name)
    step_size = control.limits.qdd_max * DT
    state, most = control.init(arm.read()), 0.0
    for step in range(250):
        if step > 60:
            arm.late = float(rng.choice([0.0] * 15 + [0.02, 0.04, 0.1, 0.5]))
            arm.set_by = float(rng.choice([0.0] * 60 + [-0.02, -1.0, 0.03, 60.0]))
            arm.lie = drawn(rng, step_size, arm.late) if rng.random() < 0.05 + 0.6 * (arm.late > 0.0) else Liar.lie
        late, before, resume = arm.late + arm.set_by > 0.0, arm.qd, bool(rng.random() < 0.3)
        options = loop.Options(resume=lambda resume=resume: resume)
        state = loop.turn(control, state, arm, arm.skin(), arm.tick(), options).after
        # an arm that got no commands may have braked: its word for that only brings it to rest
        rest = np.zeros(7) if late else before
        beyond = np.maximum(np.minimum(before, rest) - arm.qd, arm.qd - np.maximum(before, rest))
        most = max(most, (beyond / step_size).max())
    assert most <= 5.0


def drawn(rng: np.random.Generator, step_size: np.ndarray, late: float) -> Lie:
    """Draw a lie, the larger the later the tick."""
    field = str(rng.choice(["stamp", "q", "qd", "q_commanded", "qd_commanded", "qd_commanded", "tau_ext"]))
    size = {"stamp": 0.05, "q": 0.02 + late, "tau_ext": 50.0}.get(field, (1.0 + late / DT) * step_size)
    lie = rng.choice([0.5, 0.9, 1.0]) * size * rng.choice([-1.0, 1.0], () if field == "stamp" else 7)
    return lambda robot: replace(robot, **{field: getattr(robot, field) + lie})


def test_what_the_commands_of_late_explain_is_believed_as_it_is(panda_model, arm):
    control = controller(panda_model, "paper")
    robot, state = arm.read(), control.init(arm.read())
    for k in range(4):
        state.memory.put("watch.stamp", 0.01 * k)
        add_sent(state.memory.part("watch", Watched), np.full(7, 0.1 * k))
    state.memory.put("command", np.full(7, 0.4))

    def believed(qd: np.ndarray, now: float = 0.04) -> np.ndarray:
        return loop.explained(control, state, replace(robot, qd_commanded=qd), now).qd_commanded

    step = control.limits.qdd_max * DT
    for honest in (np.full(7, 0.4), np.zeros(7), np.linspace(0, 0.4, 7), 0.4 + step, -step):
        np.testing.assert_array_equal(believed(honest), honest)
    np.testing.assert_array_equal(np.isnan(believed(0.4 + 1.1 * step * np.eye(7)[2])), np.eye(7)[2] == 1)
    # a loop that was late finds an arm that has braked in the meantime, but none that has sped up or turned round
    fast = np.full(7, 1.5)
    state.memory.put("command", fast)
    state.memory.put("watch.sent", 0)
    add_sent(state.memory.part("watch", Watched), fast)
    for braked in (fast - 4.9 * step, fast + step):
        np.testing.assert_array_equal(believed(braked, now=0.08), braked)
    for other in (fast - 1.1 * step, fast + 1.1 * step):
        assert np.isnan(believed(other)).all()
    for other in (fast + 1.1 * step, fast - 5.1 * step, -fast):
        assert np.isnan(believed(other, now=0.08)).all()
    np.testing.assert_array_equal(believed(-step, now=5.0), -step)
    assert np.isnan(believed(-1.1 * step, now=5.0)).all()


@pytest.mark.parametrize("report", [None, "no arm", 3.0])
def test_what_is_no_report_is_left_for_the_step_to_name(panda_model, arm, report):
    control = controller(panda_model, "paper")
    assert loop.explained(control, control.init(arm.read()), report, 0.0) is report


@pytest.mark.parametrize("stamp", [1e308, -1e308, np.float64(1e308), 10**40, 1j, np.complex128(0.5)])
def test_a_stamp_that_is_none_is_named_though_a_position_jumps_too(panda_model, arm, stamp):
    arm.told = lambda robot: replace(robot, stamp=stamp, q=robot.q + 0.3)
    said = turned(controller(panda_model, "paper"), arm, 120)
    assert said[119].mode is Mode.TRACK
    assert said[-1].mode is Mode.HOLD
    assert "RobotState.stamp" in said[-1].reason


@pytest.mark.parametrize("field", ["q", "qd", "q_commanded", "qd_commanded", "wrench"])
def test_complex_numbers_of_an_arm_are_a_named_hold(panda_model, arm, field):
    arm.told = lambda robot: replace(robot, **{field: getattr(robot, field) + 0.5j})
    said = turned(controller(panda_model, "paper"), arm, 5)
    assert said[-1].mode is Mode.HOLD
    assert "of numbers" in said[5].reason


@pytest.mark.parametrize("value", [1e308, -1e308, 0.5j])
def test_readings_with_such_stamps_are_named_or_not_used(panda_model, paper_skin, value):
    arm = Liar(panda_model, len(paper_skin))
    control = controller_of(panda_model, paper_skin, profile("pretouch"))
    state, skin = control.init(arm.read()), arm.skin()
    readings = replace(skin.read(), stamp=np.full(len(paper_skin), value))
    skin.read = lambda: readings
    for _ in range(5):
        cycle = loop.turn(control, state, arm, skin, arm.tick())
        state = cycle.after
    assert cycle.step.mode is Mode.HOLD
    assert ("The readings do not fit" if isinstance(value, complex) else "No usable reading from") in cycle.step.reason
