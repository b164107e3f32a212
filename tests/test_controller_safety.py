"""Whatever it is given, the controller answers with a command within the limits of the arm."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.approach import ApproachRestriction
from pretouch.control.path import Circle, Path, segment
from pretouch.loop import Cycle
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Inputs, Mode, QpOutcome, RangeReadings, RangeStatus
from tests import following_arm
from tests.following_arm import DT, SHORT
from tests.fuzz import weather

HARD = replace(SHORT, approach=ApproachRestriction(rows="hard"))
FAULTS = [
    "q", "qd", "q_commanded", "qd_commanded", "wrench", "no wrench", "robot stamp", "step stamp", "stale", "backwards",
    "jump", "distance", "stamp", "dead",
]  # fmt: skip
LATCHING = FAULTS[:4] + FAULTS[6:11]
NO_VALUE = {"no wrench", "stale", "backwards", "jump", "dead"}
"""Faults that are the same whatever number is given."""


class Arm(following_arm.Arm):
    """An arm that does exactly what it is told, whatever its interface reports, and checks each command."""

    def __init__(self, model: RobotModel, skin: Skin, profile: Profile = SHORT, path: Path | None = None) -> None:
        super().__init__(model, skin, profile, path or Circle())
        self.limits = self.controller.limits

    def inputs(self, distance: float = 0.0, status: int = RangeStatus.SIGNAL) -> Inputs:
        """Inputs in which all units say the same."""
        k = len(self.skin)
        readings = RangeReadings(np.full(k, self.time), np.full(k, distance), np.full(k, int(status)))
        return Inputs(self.time, self.robot(), readings)

    def give(self, inputs: Inputs) -> Cycle:
        before, cycle = self.qd, super().give(inputs)
        assert np.all(np.isfinite(self.qd))
        assert np.all(np.abs(self.qd - before) <= self.limits.qdd_max * DT + 1e-9)
        assert cycle.step.reason
        return cycle

    def check_position_and_velocity(self) -> None:
        assert np.all(np.abs(self.qd) <= self.limits.qd_max + 1e-9)
        assert np.all(self.q >= self.limits.q_min - 1e-9)
        assert np.all(self.q <= self.limits.q_max + 1e-9)


@pytest.fixture
def arm(panda_model: RobotModel, paper_skin: Skin) -> Arm:
    """An arm with a short window, which begins to move."""
    return Arm(panda_model, paper_skin)


def hand(model: RobotModel) -> tuple[float, float, float]:
    """Where the hand is in the ready posture."""
    return tuple(model.kinematics(model.description.q_ready).position[model.ee])


def spoiled(inputs: Inputs, fault: str, value: float = np.nan) -> Inputs:
    """The same inputs with one thing wrong."""
    robot, readings = inputs.robot, inputs.readings
    if fault == "no wrench":
        return replace(inputs, robot=replace(robot, wrench=None))
    if fault == "dead":
        silent = np.full(len(readings.stamp), -np.inf), np.full(len(readings.status), int(RangeStatus.NONE))
        return replace(inputs, readings=replace(readings, stamp=silent[0], status=silent[1]))
    if fault in ("distance", "stamp"):
        wrong = getattr(readings, fault).copy()
        wrong[::2] = value
        return replace(inputs, readings=replace(readings, **{fault: wrong}))
    return weather.spoiled(inputs, fault, value)


@pytest.mark.parametrize(
    ("fault", "value"),
    [(fault, value) for fault in FAULTS for value in (np.nan, *(() if fault in NO_VALUE else (np.inf, -1e15, 1e306)))],
)
def test_one_fault_that_lasts(arm: Arm, fault: str, value: float):
    arm.run(60)
    assert np.linalg.norm(arm.qd) > 0.05
    for _ in range(60):
        last = arm.give(spoiled(arm.inputs(distance=0.3, status=RangeStatus.OK), fault, value)).step
        arm.check_position_and_velocity()
    if fault != "distance":
        assert last.mode is Mode.HOLD
        assert not arm.qd.any()
    # what latches stays, and what does not goes on by itself
    assert arm.run(60)[-1].mode is (Mode.HOLD if fault in LATCHING else Mode.TRACK)
    assert arm.step(resume=True).mode is Mode.TRACK


@pytest.mark.parametrize("value", [5.0, -20.0, 999.0])
def test_no_reported_velocity_makes_a_command_no_arm_can_follow(arm: Arm, value: float):
    arm.run(60)
    step, _ = arm.controller.step(arm.state, spoiled(arm.inputs(), "qd_commanded", value))
    assert np.all(np.abs(step.command) <= arm.limits.qd_max + arm.limits.qdd_max * DT)


@pytest.mark.parametrize("goal", [(0.0, 0.0, 3.0), (0.0, 0.0, 0.4), (0.3, 1.5, 0.3)])
@pytest.mark.parametrize("cycles", [1, 2, 4])
def test_reports_that_come_late_cost_no_limit(panda_model: RobotModel, cycles: int, goal: tuple[float, float, float]):
    # a report that is 40 ms old is still believed; braking only for where the arm was by then is too late
    arm = Arm(panda_model, Skin([], panda_model), path=segment(hand(panda_model), goal))
    reports = [arm.robot()] * (cycles + 1)
    for _ in range(800):
        reports.append(arm.robot())
        step = arm.step(change=lambda _: reports[-1 - cycles])
        arm.check_position_and_velocity()
    assert step.mode is Mode.TRACK


def test_an_arm_whose_units_were_never_heard_stands(arm: Arm):
    for _ in range(40):
        step = arm.give(spoiled(arm.inputs(), "dead")).step
        assert not arm.qd.any()
    assert step.mode is Mode.HOLD
    assert all(name in step.reason for name in arm.skin.ids)


@pytest.mark.parametrize(
    ("status", "distance"),
    [
        (RangeStatus.HARDWARE, 0.5), (RangeStatus.CROSSTALK, 0.5), (RangeStatus.SYNC, 0.5), (RangeStatus.INVALID, 0.5),
        (RangeStatus.NONE, 0.0), (RangeStatus.OK, np.nan), (RangeStatus.OK, np.inf), (RangeStatus.OK, -1.0),
    ],
)  # fmt: skip
def test_a_unit_that_only_reports_failures_is_a_silent_one(arm: Arm, status: RangeStatus, distance: float):
    arm.run(60)
    steps = []
    for _ in range(60):
        inputs = arm.inputs()
        inputs.readings.status[1], inputs.readings.distance[1] = status, distance
        steps.append(arm.give(inputs).step)
    # as if nothing came: slower from 0.1 s on, half way at 0.2 s, and standing at 0.3 s
    assert [s.speed_scale for s in steps[:9]] == [1.0] * 9
    assert steps[19].speed_scale == pytest.approx(0.5)
    assert {s.mode for s in steps[:29]} == {Mode.TRACK}
    assert {s.mode for s in steps[30:]} == {Mode.HOLD}
    assert "hand_right" in steps[-1].reason
    assert "hand_left" not in steps[-1].reason
    assert not arm.qd.any()
    again = arm.run(4)
    assert {s.mode for s in again} == {Mode.TRACK}
    # gently: the speed along the path grows from nothing, and the factor as after any obstacle
    assert np.linalg.norm(again[0].desired_velocity) < 0.05
    np.testing.assert_allclose([s.speed_scale for s in again], np.arange(1, 5) / 200)


def test_a_late_step_brakes_and_the_next_goes_on(arm: Arm):
    arm.run(60)
    before, arm.time = np.linalg.norm(arm.qd), arm.time + 0.06
    late = arm.step()
    assert late.mode is Mode.HOLD
    assert "0.070 s ago, because this machine is busy" in late.reason
    assert np.linalg.norm(arm.qd) < before
    assert arm.step().mode is Mode.TRACK


def test_a_blocked_arm_brakes_and_tries_again_at_each_step(panda_model: RobotModel, paper_skin: Skin):
    x, y, z = hand(panda_model)
    arm = Arm(panda_model, paper_skin, HARD, Circle((x, y - 0.25, z)))  # it begins at the hand
    arm.run(100)
    steps = [arm.give(arm.inputs(0.1, RangeStatus.OK)).step for _ in range(5)]
    assert steps[0].qp.outcome is QpOutcome.INFEASIBLE
    assert "tries again" in steps[0].reason
    for step in steps:
        assert (step.mode is Mode.HOLD) == (step.qp.outcome is QpOutcome.INFEASIBLE)
    assert arm.run(20)[-1].mode is Mode.TRACK


def test_a_blocked_reaction_stays_one(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin, replace(HARD, detect=replace(HARD.detect, compare="raw")))
    arm.run(20)
    assert arm.run(30, force=(0.0, 60.0, 0.0))[-1].mode is Mode.REACT
    step = arm.give(arm.inputs(0.04, RangeStatus.OK)).step
    assert step.qp.outcome is QpOutcome.INFEASIBLE
    assert step.mode is Mode.REACT
    assert "allow no motion" in step.reason
    assert arm.step().mode is Mode.REACT


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("joint", range(7))
def test_an_arm_that_starts_beyond_a_joint_limit_never_goes_further(arm: Arm, joint: int, sign: float):
    beyond = (arm.limits.q_max if sign > 0 else arm.limits.q_min)[joint] + sign * 0.05
    arm.q[joint] = beyond
    arm.state = arm.controller.init(arm.robot())
    for _ in range(100):
        before = arm.q[joint]
        arm.step()
        if sign * (before - (beyond - sign * 0.05)) > 0:
            assert sign * arm.qd[joint] <= 1e-12
    assert sign * (arm.q[joint] - beyond) <= 1e-12


@pytest.mark.parametrize("factor", [0.9, 1.5])
def test_an_arm_that_is_handed_over_moving_brakes_within_its_limits(arm: Arm, factor: float):
    arm.qd = factor * arm.limits.qd_max * np.array([1, -1, 1, 1, -1, 1, -1])
    arm.state = arm.controller.init(arm.robot())
    for _ in range(5):  # the window is filling, so the arm holds
        before = np.abs(arm.qd)
        arm.step()
        assert np.all(np.abs(arm.qd) <= before)
    assert np.all(np.abs(arm.qd) < factor * arm.limits.qd_max)


@pytest.mark.parametrize("goal", [(3.0, 0.0, 0.5), (0.0, 0.0, 3.0), (0.0, 0.0, 0.4), (0.4, 2.0, 0.1)])
def test_a_path_out_of_reach_ends_within_the_limits(
    panda_model: RobotModel, paper_skin: Skin, goal: tuple[float, float, float]
):
    # a stretched arm is singular, and one folded into itself meets its joint limits
    arm = Arm(panda_model, paper_skin, path=segment(hand(panda_model), goal))
    for _ in range(800):
        step = arm.step()
        arm.check_position_and_velocity()
    assert step.qp.outcome is QpOutcome.SOLVED
