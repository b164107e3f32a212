"""The port `Robot` over ROS 2: what is sent, and what is given as commanded."""

from time import monotonic, sleep, time, time_ns
from typing import Any

import numpy as np
import pytest

from pretouch.errors import RobotError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch_ros2.messages import JOINT_STATE, TRAJECTORY, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams, seconds
from pretouch_ros2.robot import Ros2Robot

READY = panda().q_ready
SLOW = np.full(7, 0.05)


class Driver:
    """The other side: publishes joint states and a wrench, and keeps the commands."""

    def __init__(self, node: Ros2Node, params: ArmParams, model: RobotModel) -> None:
        self.node, self.names = node, list(params.joint_names or model.joints)
        self.commands: list[Any] = []
        node.subscribe(
            params.command_topic, TRAJECTORY, lambda message, *_: self.commands.append(message), reliable=True
        )
        self._states = node.publisher(params.joint_states, JOINT_STATE)
        self._wrench = node.publisher(params.wrench, WRENCH)
        assert node.wait_for(lambda: self._states.subscribers == self._wrench.subscribers == 1, 10)

    def tell(self, q: np.ndarray, robot: Ros2Robot, old: float = 0.0) -> None:
        """Publish a state, and wait until it has come."""
        stamp = time_ns() - round(old * 1e9)
        header, came = self.node.messages.header(divmod(stamp, 10**9), ""), robot._joints.newest
        make = self.node.messages.make
        self._wrench.publish(make(WRENCH, header=header))
        self._states.publish(make(JOINT_STATE, header, self.names, q, np.zeros(7), np.zeros(0)))
        assert self.node.wait_for(lambda: robot._joints.newest is not came, 5)

    def command(self, number: int) -> Any:
        assert self.node.wait_for(lambda: len(self.commands) >= number, 5), self.commands
        return self.commands[number - 1]


@pytest.fixture
def params():
    return ArmParams("on-robot", "base", settle_s=0.3, hold_s=0.4)


@pytest.fixture
def robot(params, panda_model, node):
    with Ros2Robot(params, panda_model, node) as robot:
        yield robot


@pytest.fixture
def driver(params, panda_model, robot, other):
    driver = Driver(other, params, panda_model)
    for _ in range(3):  # one may be late on a busy machine
        driver.tell(READY, robot)
    robot.wait(10)
    return driver


def test_the_first_trajectory_goes_to_where_the_arm_was_measured(robot, driver):
    q = robot.read().q
    before = monotonic()
    robot.begin()
    assert monotonic() - before >= 0.3
    sent = driver.command(1)
    assert sent.joint_names == driver.names
    (point,) = sent.points
    assert point.positions.tolist() == q.tolist()
    assert not point.velocities.any()
    assert seconds(point.time_from_start.sec, point.time_from_start.nanosec) == pytest.approx(0.3)
    assert abs(seconds(sent.header.stamp.sec, sent.header.stamp.nanosec) - time()) < 1.0
    for _ in range(3):
        robot.command(np.zeros(7))
    sleep(0.05)
    assert len(driver.commands) == 1  # none at rest


@pytest.mark.parametrize(("old", "q3", "said"), [(0.0, np.nan, "not all finite"), (1.5, 0.0, r"1\.[5-9]. s")])
def test_from_a_state_that_tells_nothing_no_arm_begins(robot, driver, old, q3, said):
    q = READY.copy()
    q[3] += q3
    sleep(0.15 if old else 0.0)
    if old:
        robot._joints.stamps._writers.clear()  # as of another driver
    driver.tell(q, robot, old)
    robot.read()
    for begin in (robot.begin, lambda: robot.command(np.zeros(7))):
        with pytest.raises(RobotError, match=said):
            begin()
    sleep(0.05)
    assert not driver.commands


def test_before_any_command_an_arm_moved_by_hand_is_where_it_is_measured(robot, driver):
    moved = READY + 0.3
    driver.tell(moved, robot)
    state = robot.read()
    assert state.q_commanded.tolist() == state.q.tolist() == moved.tolist()
    assert not state.qd_commanded.any()


def test_a_moving_command_brings_its_past_is_kept_and_then_brakes_to_rest(robot, driver):
    robot.begin()
    driver.tell(READY, robot)
    robot.read()
    robot.command(SLOW)
    sent = driver.command(2)
    times = [seconds(p.time_from_start.sec, p.time_from_start.nanosec) for p in sent.points]
    begin = seconds(sent.header.stamp.sec, sent.header.stamp.nanosec)
    assert times[0] == 0
    assert begin < time()
    kept = [t for t, p in zip(times, sent.points, strict=True) if p.velocities == pytest.approx(SLOW)]
    assert kept[-1] - kept[0] == pytest.approx(0.39)
    assert not sent.points[-1].velocities.any()
    sleep(0.02)
    driver.tell(READY, robot)
    state = robot.read()
    assert state.qd_commanded == pytest.approx(SLOW)
    assert (state.q_commanded > state.q).all()
    sleep(0.5)
    driver.tell(READY + 0.02, robot)
    state = robot.read()
    assert not state.qd_commanded.any()
    assert state.q_commanded == pytest.approx(state.q, abs=1e-3)


def test_an_arm_that_does_not_follow_is_an_error_that_names_the_joint_and_is_sent_nothing_more(robot, driver):
    robot.begin()
    away = READY.copy()
    away[3] += 0.2
    driver.tell(away, robot)
    said = r"does not follow: panda_joint4 is at -2.156 rad, but was commanded to -2.356 rad"
    with pytest.raises(RobotError, match=said):
        robot.read()
    assert robot.read().q[3] == away[3]  # it can still be watched
    with pytest.raises(RobotError, match=said):
        robot.command(SLOW)
    sleep(0.05)
    assert len(driver.commands) == 1


def test_a_state_without_numbers_does_not_end_the_watch_over_the_arm(robot, driver):
    robot.begin()
    driver.tell(np.full(7, np.nan), robot)
    assert np.isnan(robot.read().q).all()  # for the controller to name
    driver.tell(READY + 1.0, robot)
    with pytest.raises(RobotError, match="does not follow"):
        robot.read()


def test_a_second_program_that_commands_the_arm_is_refused_and_ends_a_run(
    robot, driver, params, panda_model, node, third
):
    robot.read()
    with Ros2Robot(params, panda_model, third) as second:
        assert third.wait_for(lambda: bool(second._conflict()), 10)
        with pytest.raises(RobotError, match="Another program publishes on /joint_trajectory_controller"):
            second.wait(0.1)
        assert node.wait_for(lambda: bool(robot._conflict()), 10)
        with pytest.raises(RobotError, match="Another program publishes"):
            robot.read()


def test_a_second_driver_of_the_arm_is_refused(robot, driver, params, panda_model, third):
    again = Driver(third, params, panda_model)
    for each in (driver, again, driver):
        each.tell(READY, robot)
    with pytest.raises(RobotError, match="Several publishers send on /joint_states"):
        robot.read()


@pytest.mark.parametrize("params", [ArmParams("by-robot", "base", torques="/tau")])
def test_torques_that_were_asked_for_are_waited_for_and_read(robot, params, panda_model, node, other):
    driver = Driver(other, params, panda_model)
    driver.tell(READY, robot)
    with pytest.raises(RobotError, match=r"Nothing was received on /tau: start its publisher, .* set torques to one"):
        robot.wait(0.1)
    make, header = other.messages.make, other.messages.header
    publisher, none = other.publisher("/tau", JOINT_STATE), np.zeros(0)
    assert other.wait_for(lambda: publisher.subscribers == 1, 10)

    def send(names: list[str]) -> None:
        stamp = header(divmod(time_ns(), 10**9), "")
        publisher.publish(make(JOINT_STATE, stamp, names, none, none, np.arange(len(names), dtype=float)))

    send(["finger"])
    assert node.wait_for(lambda: bool(robot._torques.others), 5)
    with pytest.raises(RobotError, match=r"/tau has efforts of finger, not of panda_joint1, "):
        robot.wait(0.1)
    send(driver.names)
    assert node.wait_for(lambda: robot._torques.received_any, 5)
    assert robot.read().tau_ext.tolist() == [0, -1, -2, -3, -4, -5, -6]
    robot.wait(10)


def test_a_failure_of_the_receiving_thread_stops_the_arm(robot, driver, node):
    def fail(*_: object) -> None:
        raise ValueError("no such joint")

    robot._states._on_message = fail
    driver._states.publish(driver.node.messages.make(JOINT_STATE))
    assert node.wait_for(lambda: bool(node.failure), 5)
    with pytest.raises(RobotError, match=r"Receiving from ROS 2 failed \(ValueError: no such joint"):
        robot.read()


def test_a_command_that_is_no_number_is_refused(robot, driver):
    with pytest.raises(RobotError, match="give finite joint velocities"):
        robot.command(np.full(7, np.nan))


@pytest.mark.parametrize("params", [ArmParams("on-robot", "base", shared_clock=False, settle_s=0.2)])
def test_without_one_clock_trajectories_begin_as_they_come(robot, driver):
    assert "only joint_trajectory_controller 4.17 to 4.20 moves smoothly" in robot.notes[0]
    robot.begin()
    driver.tell(READY, robot)
    robot.command(SLOW)
    sent = driver.command(2)
    assert sent.header.stamp.sec == sent.header.stamp.nanosec == 0
    assert sent.points[0].velocities == pytest.approx(SLOW)
    assert sent.points[0].time_from_start.nanosec == pytest.approx(50e6)
    assert robot.read().stamp > monotonic() - 5


def test_a_clock_that_is_not_shared_is_refused(robot, params, panda_model, other):
    Driver(other, params, panda_model).tell(READY, robot, 100.0)
    with pytest.raises(RobotError, match=r"stamps of /joint_states are 100 s behind .* NTP"):
        robot.wait(10)


def test_everything_unusual_is_noted(robot, driver, other, params):
    assert robot.notes == ()
    other.subscribe(params.command_topic, TRAJECTORY, lambda *_: None)
    assert other.wait_for(lambda: robot.notes == (f"{params.command_topic} has 2 subscribers.",), 10)
