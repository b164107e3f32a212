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


class Clockwork:
    """The arm's clock, but what `odd` says of the number of a tick, where it says something."""

    def __init__(self, arm: Arm, odd: Callable[[int], float | None]) -> None:
        self._arm, self._odd, self._count = arm, odd, 0

    def tick(self) -> float:
        self._count += 1
        odd = self._odd(self._count)
        now = self._arm.tick()
        return now if odd is None else odd


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
        (lambda s: replace(s, tau_ext=0.0), r"^The robot's external torques have the shape \(\), not \(7,\): check"),
        (lambda s: replace(s, tau_ext=np.zeros(1)), r"external torques have the shape \(1,\), not \(7,\)"),
        (lambda s: replace(s, tau_ext=None), r"external torques have the shape \(\), not \(7,\)"),
        (lambda s: replace(s, tau_ext="none"), "^The robot's external torques are not an array of numbers: check"),
        (lambda s: replace(s, stamp=s.stamp + 0.5), r"newest state is 0.500 s in the future"),
        (
            lambda s: replace(s, q_commanded=s.q + 0.04 * np.eye(7)[3]),
            r"joint4 is 0.040 rad from its commanded position",
        ),
        (lambda s: None, "state cannot be used: it is None"),
    ],
    ids=[
        "stale",
        "strayed",
        "nan",
        "pushed",
        "nan torques",
        "scalar",
        "one torque",
        "no torques",
        "words",
        "future",
        "dragged",
        "none",
    ],
)
def test_what_is_not_as_planned_stops_the_arm_and_what_was_measured_is_kept(arm: Arm, tell, words: str):
    done = done_with(arm, tell)
    assert done.stopped is not None
    assert re.search(words, done.stopped)
    assert len(done.joints.stamp) == pytest.approx(300, abs=2)
    arm.assert_rested_within_limits()


def test_a_state_that_no_longer_changes_stops_it(arm: Arm):
    done = done_with(arm, lambda state: replace(state, stamp=8.0))
    assert done.stopped is not None
    assert "check the connection" in done.stopped
    arm.assert_rested_within_limits()


@pytest.mark.parametrize("late", [-0.09, 0.09])
def test_a_state_is_compared_with_the_plan_at_its_own_instant(arm: Arm, late: float):
    """At 0.6 rad/s and more an arm is 0.05 rad further 0.09 s later: too far off the plan, were it of that instant."""
    plan, seen, begin = plan_for(arm.model), [(arm.now, arm.q)], arm.now

    def delayed(state: RobotState) -> RobotState:
        seen.append((state.stamp, state.q))
        stamp, q = state.stamp - late, state.q
        if late > 0:
            stamp, q = min(seen, key=lambda one: abs(one[0] - stamp))
        elif state.stamp > begin + 2 * DT:
            q = plan.at(stamp - begin - 2 * DT)[0]
        return replace(state, stamp=stamp, q=q, q_commanded=q)

    arm.tell = delayed
    done = perform(arm, arm, arm.model, plan, replace(PARAMS, gain_1_s=0.0))
    assert np.abs(plan.sampled(100.0).qd).max() * abs(late) > 1.5 * PARAMS.path_tolerance_rad
    assert done.stopped is None


@pytest.mark.parametrize("tick", [np.nan, np.inf])
def test_a_tick_that_is_no_instant_is_not_the_end_of_the_plan(arm: Arm, tick: float):
    clock = Clockwork(arm, lambda count: tick if count == 300 else None)
    done = perform(arm, clock, arm.model, plan_for(arm.model))
    assert done.stopped == f"The clock ticked at {tick} s: check the clock."
    assert len(done.joints.stamp) == 298
    arm.assert_rested_within_limits()


@pytest.mark.parametrize("times", [1, 2, 10])
def test_commands_that_fail_are_given_again_until_the_arm_rests(arm: Arm, times: int):
    send, count = arm.command, 0

    def command(qd: np.ndarray) -> None:
        nonlocal count
        count += 1
        if 250 <= count < 250 + times:
            raise OSError(f"hiccup {count}")
        send(qd)

    arm.command = command
    done = perform(arm, arm, arm.model, plan_for(arm.model))
    rest = " The arm could not be brought to rest without an error: OSError: hiccup 251" if times > 1 else ""
    assert done.stopped == "OSError: hiccup 250" + ("." + rest if rest else "")
    assert len(done.joints.stamp) == 250
    arm.assert_rested_within_limits()


@pytest.mark.parametrize("times", [1, 2, 1000])
def test_an_arm_rests_though_its_clock_fails(arm: Arm, times: int):
    def fail(count: int) -> None:
        if 250 <= count < 250 + times:
            raise OSError("no tick")

    done = perform(arm, Clockwork(arm, fail), arm.model, plan_for(arm.model))
    assert done.stopped is not None
    assert done.stopped.startswith("OSError: no tick")
    assert ("could not be brought to rest without an error: OSError: no tick" in done.stopped) == (times > 1)
    assert len(done.joints.stamp) == 248
    arm.assert_rested_within_limits()


def test_an_arm_that_takes_no_command_is_given_up_and_what_was_measured_is_kept(arm: Arm):
    send = arm.command

    def command(qd: np.ndarray) -> None:
        if len(arm.commands) >= 250:
            raise OSError("gone")
        send(qd)

    arm.command = command
    done = perform(arm, arm, arm.model, plan_for(arm.model))
    assert done.stopped == "OSError: gone. The arm could not be brought to rest without an error: OSError: gone"
    assert len(done.joints.stamp) == 251


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
        (lambda s: replace(s, q=s.q + 0.1 * np.eye(7)[5]), "joint6 is 0.100 rad off .* move the arm there first"),
        (lambda s: replace(s, qd_commanded=np.full(7, 0.1)), r"is moving, panda_joint1 at 0.100 rad/s"),
        (lambda s: replace(s, qd=-0.5 * np.eye(7)[2]), r"is moving, panda_joint3 at 0.500 rad/s"),
        (lambda s: replace(s, stamp=s.stamp - 100.0), r"newest state is 100.000 s old"),
        (
            lambda s: replace(s, q_commanded=s.q - 0.3 * np.eye(7)[1]),
            r"joint2 is 0.300 rad from its commanded position",
        ),
        (lambda s: replace(s, tau_ext=np.zeros(1)), r"external torques have the shape \(1,\)"),
        (lambda s: replace(s, q=s.q[:3]), "state cannot be used"),
    ],
)
def test_an_arm_that_is_not_ready_is_sent_nothing(arm: Arm, tell, words: str):
    arm.tell = tell
    with pytest.raises(CalibrationError, match=words):
        perform(arm, arm, arm.model, plan_for(arm.model))
    assert arm.commands == []


def test_an_arm_that_is_at_rest_but_for_noise_and_rounding_is_ready(arm: Arm):
    noise = 0.02 * np.ones(7)
    arm.tell = lambda state: replace(
        state, qd=state.qd + noise, q_commanded=state.q_commanded + 0.005, qd_commanded=state.qd_commanded + 1e-9
    )
    assert perform(arm, arm, arm.model, plan_for(arm.model)).stopped is None
