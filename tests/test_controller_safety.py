"""Whatever it is given, the controller answers with a command within the limits of the arm."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.approach_restriction import ApproachRestriction
from pretouch.control.path import Circle, Path, line
from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Inputs, Mode, QpOutcome, RangeReadings, RangeStatus, RobotState

DT = 0.01
SHORT = replace(PROFILES["paper"], window=replace(PROFILES["paper"].window, samples=5))
HARD = replace(SHORT, approach=ApproachRestriction(rows="hard"))
FAULTS = [
    "q", "qd", "q_commanded", "qd_commanded", "wrench", "no wrench", "robot stamp", "step stamp", "stale", "backwards",
    "jump", "distance", "range stamp", "dead",
]  # fmt: skip
LATCHING = FAULTS[:4] + FAULTS[6:11]


class Arm:
    """An arm that does exactly what it is told, whatever its interface reports, and checks each command."""

    def __init__(self, model: RobotModel, skin: Skin, profile: Profile = SHORT, path: Path | None = None) -> None:
        self.model, self.skin = model, skin
        self.q, self.qd, self.time = model.description.q_ready.copy(), np.zeros(7), 0.0
        self.controller = Controller(model, skin, no_fixtures(), path or Circle(), profile)
        self.limits = self.controller.limits
        self.start()

    def start(self) -> None:
        self.state = self.controller.init(self.robot())

    def robot(self, force: np.ndarray | None = None) -> RobotState:
        wrench = np.concatenate([np.zeros(3) if force is None else force, np.zeros(3)])
        return RobotState(self.time, self.q, self.qd, self.q, self.qd, np.zeros(7), wrench)

    def inputs(
        self, distance: float = 0.0, status: int = RangeStatus.SIGNAL, force: np.ndarray | None = None
    ) -> Inputs:
        k = len(self.skin)
        readings = RangeReadings(np.full(k, self.time), np.full(k, distance), np.full(k, int(status)))
        return Inputs(self.time, self.robot(force), readings)

    def step(self, inputs: Inputs) -> ControlStep:
        step, self.state = self.controller.step(self.state, inputs)
        assert np.all(np.isfinite(step.command))
        assert np.all(np.abs(step.command - self.qd) <= self.limits.qdd_max * DT + 1e-9)
        assert step.reason
        self.qd, self.q, self.time = step.command, self.q + step.command * DT, self.time + DT
        return step

    def check_position_and_velocity(self) -> None:
        assert np.all(np.abs(self.qd) <= self.limits.qd_max + 1e-9)
        assert np.all(self.q >= self.limits.q_min - 1e-9)
        assert np.all(self.q <= self.limits.q_max + 1e-9)


def circle_at_the_hand(model: RobotModel) -> Circle:
    """A circle that begins where the hand is."""
    x = model.kinematics(model.description.q_ready).position[model.ee]
    return Circle((x[0], x[1] - 0.25, x[2]))


def spoiled(inputs: Inputs, fault: str, value: float = np.nan) -> Inputs:
    """The same inputs with one thing wrong."""
    robot, readings, now = inputs.robot, inputs.readings, inputs.stamp
    if fault in ("q", "qd", "q_commanded", "qd_commanded", "wrench"):
        wrong = getattr(robot, fault).copy()
        wrong[3] = value
        return replace(inputs, robot=replace(robot, **{fault: wrong}))
    if fault in ("no wrench", "robot stamp", "stale"):
        wrong = {"no wrench": {"wrench": None}, "robot stamp": {"stamp": value}, "stale": {"stamp": now - 0.2}}[fault]
        return replace(inputs, robot=replace(robot, **wrong))
    if fault in ("step stamp", "backwards", "jump"):
        return replace(inputs, stamp={"step stamp": value, "backwards": now - 1.0, "jump": now + 60.0}[fault])
    if fault == "dead":
        silent = replace(readings, stamp=np.full(len(readings.stamp), -np.inf))
        return replace(inputs, readings=replace(silent, status=np.full(len(readings.status), 255)))
    name = {"distance": "distance", "range stamp": "stamp"}[fault]
    wrong = getattr(readings, name).copy()
    wrong[::2] = value
    return replace(inputs, readings=replace(readings, **{name: wrong}))


def assert_at_rest(arm: Arm) -> None:
    np.testing.assert_array_equal(arm.qd, 0.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("fault", FAULTS)
def test_one_fault_that_lasts(panda_model: RobotModel, paper_skin: Skin, fault: str, value: float):
    arm = Arm(panda_model, paper_skin)
    for _ in range(60):
        arm.step(arm.inputs())
    assert np.linalg.norm(arm.qd) > 0.05
    for _ in range(60):
        last = arm.step(spoiled(arm.inputs(distance=0.3, status=RangeStatus.OK), fault, value))
        arm.check_position_and_velocity()
    if fault != "distance":
        assert last.mode is Mode.HOLD
        assert_at_rest(arm)
    for _ in range(60):
        last = arm.step(arm.inputs())
    # what latches stays, and what does not goes on by itself
    assert last.mode is (Mode.HOLD if fault in LATCHING else Mode.TRACK)
    assert arm.step(replace(arm.inputs(), resume=True)).mode is Mode.TRACK


@pytest.mark.parametrize("value", [1e3, -1e9, 1e306, -1.7e308])
@pytest.mark.parametrize("name", ["q", "qd", "q_commanded", "qd_commanded"])
def test_a_number_no_arm_has_is_not_believed(panda_model: RobotModel, paper_skin: Skin, name: str, value: float):
    arm = Arm(panda_model, paper_skin)
    for _ in range(60):
        arm.step(arm.inputs())
    before = np.linalg.norm(arm.qd)
    step = arm.step(spoiled(arm.inputs(), name, value))
    assert step.mode is Mode.HOLD
    assert arm.state.mode.latched
    assert np.linalg.norm(arm.qd) < before
    assert {"q": "positions", "qd": "velocities"}[name.split("_")[0]] in step.reason


@pytest.mark.parametrize("value", [5.0, -20.0, 999.0])
def test_no_reported_velocity_makes_a_command_no_arm_can_follow(
    panda_model: RobotModel, paper_skin: Skin, value: float
):
    arm = Arm(panda_model, paper_skin)
    for _ in range(60):
        arm.step(arm.inputs())
    step, _ = arm.controller.step(arm.state, spoiled(arm.inputs(), "qd_commanded", value))
    assert np.all(np.abs(step.command) <= arm.limits.qd_max + arm.limits.qdd_max * DT)


@pytest.mark.parametrize("goal", [(0.0, 0.0, 3.0), (0.0, 0.0, 0.4), (0.3, 1.5, 0.3)])
@pytest.mark.parametrize("cycles", [1, 2, 4])
def test_reports_that_come_late_cost_no_limit(panda_model: RobotModel, cycles: int, goal: tuple[float, float, float]):
    # a report that is 40 ms old is still believed; braking only for where the arm was by then is too late
    start = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee]
    arm = Arm(panda_model, Skin([], panda_model), path=line(tuple(start), goal))
    reports = [arm.robot()] * (cycles + 1)
    for _ in range(800):
        reports.append(arm.robot())
        step = arm.step(replace(arm.inputs(), robot=reports[-1 - cycles]))
        arm.check_position_and_velocity()
    assert step.mode is Mode.TRACK


def test_a_report_from_the_future_is_called_so(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin)
    inputs = arm.inputs()
    step = arm.step(replace(inputs, robot=replace(inputs.robot, stamp=inputs.stamp + 0.1)))
    assert step.mode is Mode.HOLD
    assert "0.100 s in the future" in step.reason
    assert "-0.100" not in step.reason


def test_an_arm_without_units_follows_its_path(panda_model: RobotModel):
    arm = Arm(panda_model, Skin([], panda_model))
    for _ in range(40):
        step = arm.step(arm.inputs())
        arm.check_position_and_velocity()
    assert step.mode is Mode.TRACK
    assert step.speed_scale == 1.0


def test_an_arm_whose_units_were_never_heard_stands(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin)
    for _ in range(40):
        step = arm.step(spoiled(arm.inputs(), "dead"))
        assert_at_rest(arm)
    assert step.mode is Mode.HOLD
    assert all(name in step.reason for name in paper_skin.ids)


def one_unit_says(arm: Arm, status: RangeStatus, distance: float) -> Inputs:
    """Unit 1 reports this at every step, the others that there is no target."""
    inputs = arm.inputs()
    readings = inputs.readings
    readings.status[1], readings.distance[1] = status, distance
    return inputs


@pytest.mark.parametrize(
    ("status", "distance"),
    [
        (RangeStatus.HARDWARE, 0.5), (RangeStatus.CROSSTALK, 0.5), (RangeStatus.SYNC, 0.5), (RangeStatus.INVALID, 0.5),
        (RangeStatus.NONE, 0.0), (RangeStatus.OK, np.nan), (RangeStatus.OK, np.inf), (RangeStatus.OK, -1.0),
    ],
)  # fmt: skip
def test_a_unit_that_only_reports_failures_is_a_silent_one(
    panda_model: RobotModel, paper_skin: Skin, status: RangeStatus, distance: float
):
    arm = Arm(panda_model, paper_skin)
    for _ in range(60):
        arm.step(arm.inputs())
    steps = [arm.step(one_unit_says(arm, status, distance)) for _ in range(60)]
    # as if nothing came: slower from 0.1 s on, half way at 0.2 s, and standing at 0.3 s
    assert [s.speed_scale for s in steps[:9]] == [1.0] * 9
    assert steps[19].speed_scale == pytest.approx(0.5)
    assert {s.mode for s in steps[:29]} == {Mode.TRACK}
    assert {s.mode for s in steps[30:]} == {Mode.HOLD}
    assert "hand_right" in steps[-1].reason
    assert "hand_left" not in steps[-1].reason
    assert_at_rest(arm)
    assert arm.step(arm.inputs()).mode is Mode.TRACK


@pytest.mark.parametrize(
    ("status", "distance"),
    [
        (RangeStatus.SIGNAL, 0.5), (RangeStatus.SIGMA, 0.5), (RangeStatus.OUT_OF_BOUNDS, 0.5),
        (RangeStatus.WRAPPED, 0.5), (RangeStatus.OK, 100.0),
    ],
)  # fmt: skip
def test_a_unit_that_sees_no_target_is_well(
    panda_model: RobotModel, paper_skin: Skin, status: RangeStatus, distance: float
):
    arm = Arm(panda_model, paper_skin)
    steps = [arm.step(one_unit_says(arm, status, distance)) for _ in range(60)]
    assert {s.mode for s in steps[10:]} == {Mode.TRACK}
    assert {s.speed_scale for s in steps} == {1.0}


def test_a_late_step_brakes_and_the_next_goes_on(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin)
    for _ in range(60):
        arm.step(arm.inputs())
    before, arm.time = np.linalg.norm(arm.qd), arm.time + 0.06
    late = arm.step(arm.inputs())
    assert late.mode is Mode.HOLD
    assert "0.070 s ago" in late.reason
    assert np.linalg.norm(arm.qd) < before
    assert arm.step(arm.inputs()).mode is Mode.TRACK


def test_a_blocked_arm_brakes_and_tries_again_at_each_step(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin, HARD, circle_at_the_hand(panda_model))
    for _ in range(100):
        arm.step(arm.inputs())
    steps = [arm.step(arm.inputs(0.1, RangeStatus.OK)) for _ in range(5)]
    assert steps[0].qp.outcome is QpOutcome.INFEASIBLE
    assert "trying again" in steps[0].reason
    for step in steps:
        assert (step.mode is Mode.HOLD) == (step.qp.outcome is QpOutcome.INFEASIBLE)
    for _ in range(20):
        last = arm.step(arm.inputs())
    assert last.mode is Mode.TRACK


def test_a_blocked_reaction_stays_one(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin, replace(HARD, detect=replace(HARD.detect, compare="raw")))
    for _ in range(20):
        arm.step(arm.inputs())
    for _ in range(30):
        step = arm.step(arm.inputs(force=np.array([0.0, 60.0, 0.0])))
    assert step.mode is Mode.REACT
    step = arm.step(arm.inputs(0.04, RangeStatus.OK))
    assert step.qp.outcome is QpOutcome.INFEASIBLE
    assert step.mode is Mode.REACT
    assert "allow no motion" in step.reason
    assert arm.step(arm.inputs()).mode is Mode.REACT


def test_only_what_is_within_notice_restricts(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin)
    inputs = arm.inputs(0.3, RangeStatus.OK)
    inputs.readings.distance[0] = 1.5
    step = arm.step(inputs)
    assert len(step.restricted) == len(step.approach_limit) == len(step.qp.slack) > 0
    # d_notice is 0.6 m
    np.testing.assert_array_equal(step.restricted, np.flatnonzero(step.obstacles.body_distance < 0.6))
    assert 0 in step.obstacles.unit
    assert 0 not in step.obstacles.unit[step.restricted]


def test_a_step_says_where_the_motion_generator_was(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin)
    inputs = arm.inputs()
    step = arm.step(replace(inputs, robot=replace(inputs.robot, q_commanded=arm.q + 0.01)))
    np.testing.assert_allclose(step.q_commanded - step.q, 0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("joint", range(7))
def test_an_arm_that_starts_beyond_a_joint_limit_never_goes_further(
    panda_model: RobotModel, paper_skin: Skin, joint: int, sign: float
):
    arm = Arm(panda_model, paper_skin)
    beyond = (arm.limits.q_max if sign > 0 else arm.limits.q_min)[joint] + sign * 0.05
    arm.q[joint] = beyond
    arm.start()
    for _ in range(100):
        before = arm.q[joint]
        arm.step(arm.inputs())
        if sign * (before - (beyond - sign * 0.05)) > 0:
            assert sign * arm.qd[joint] <= 1e-12
    assert sign * (arm.q[joint] - beyond) <= 1e-12


@pytest.mark.parametrize("factor", [0.9, 1.5])
def test_an_arm_that_is_handed_over_moving_brakes_within_its_limits(
    panda_model: RobotModel, paper_skin: Skin, factor: float
):
    arm = Arm(panda_model, paper_skin)
    arm.qd = factor * arm.limits.qd_max * np.array([1, -1, 1, 1, -1, 1, -1])
    arm.start()
    for _ in range(5):  # the window is filling, so the arm holds
        before = np.abs(arm.qd)
        arm.step(arm.inputs())
        assert np.all(np.abs(arm.qd) <= before)
    assert np.all(np.abs(arm.qd) < factor * arm.limits.qd_max)


@pytest.mark.parametrize("goal", [(3.0, 0.0, 0.5), (0.0, 0.0, 3.0), (0.0, 0.0, 0.4), (0.4, 2.0, 0.1)])
def test_a_path_out_of_reach_ends_within_the_limits(
    panda_model: RobotModel, paper_skin: Skin, goal: tuple[float, float, float]
):
    # a stretched arm is singular, and one folded into itself meets its joint limits
    start = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee]
    arm = Arm(panda_model, paper_skin, path=line(tuple(start), goal))
    for _ in range(800):
        step = arm.step(arm.inputs())
        arm.check_position_and_velocity()
    assert step.qp.outcome is QpOutcome.SOLVED


@pytest.mark.parametrize("name", ["paper", "pretouch"])
def test_how_long_no_force_was_given_is_said_of_all_that_time(panda_model: RobotModel, paper_skin: Skin, name: str):
    arm = Arm(panda_model, paper_skin, PROFILES[name])
    for i in range(360):
        inputs = arm.inputs()
        if i >= 120:
            robot = replace(inputs.robot, wrench=None, tau_ext=np.full(7, np.nan))
            inputs = replace(inputs, robot=robot)
        step = arm.step(inputs)
    assert "has given no force estimate for 2.40 s" in step.reason
