"""The port `Robot` over ROS 2: what is sent, and what is given as commanded."""

from collections.abc import Iterator
from time import monotonic, sleep, time
from typing import Any

import numpy as np
import pytest

from pretouch.errors import RobotError
from pretouch.hardware.ros2.messages import JOINT_STATE, TRAJECTORY, VELOCITIES, WRENCH
from pretouch.hardware.ros2.node import Ros2Node
from pretouch.hardware.ros2.params import ArmParams, seconds
from pretouch.hardware.ros2.robot import Ros2Robot
from pretouch.robot.model import RobotModel

SLOW = np.full(7, 0.05)


class Driver:
    """The other side: publishes joint states and a wrench, and keeps the commands."""

    def __init__(self, node: Ros2Node, params: ArmParams, model: RobotModel) -> None:
        self.node, self.names = node, list(params.joint_names or model.joints)
        self.commands: list[Any] = []
        kind = TRAJECTORY if params.command == "trajectory" else VELOCITIES
        node.subscribe(params.commands_on, kind, lambda message, *_: self.commands.append(message), reliable=True)
        self._states = node.publisher(params.joint_states, JOINT_STATE)
        self._wrench = node.publisher(params.wrench, WRENCH)
        self._count = 0
        assert node.wait_for(lambda: self._states.subscribers == self._wrench.subscribers == 1, 10)

    def tell(self, q: np.ndarray, robot: Ros2Robot) -> None:
        """Publish a state, and wait until it has come."""
        self._count += 1
        header, came = self.node.messages.header((self._count, 0), ""), robot._joints.newest
        blank = self.node.messages.blank(WRENCH)
        self._wrench.publish(self.node.messages.types[WRENCH](**(blank | {"header": header})))
        state = self.node.messages.make(JOINT_STATE, header, self.names, q, np.zeros(7), np.zeros(0))
        self._states.publish(state)
        assert self.node.wait_for(lambda: robot._joints.newest is not came, 5)

    def command(self, number: int) -> Any:
        assert self.node.wait_for(lambda: len(self.commands) >= number, 5), self.commands
        return self.commands[number - 1]


@pytest.fixture
def params() -> ArmParams:
    return ArmParams("on-robot", "base", settle_s=0.4, hold_s=0.4)


@pytest.fixture
def pair(
    params: ArmParams, panda_model: RobotModel, node: Ros2Node, other: Ros2Node
) -> Iterator[tuple[Ros2Robot, Driver]]:
    with Ros2Robot(params, panda_model, node) as robot:
        driver = Driver(other, params, panda_model)
        driver.tell(panda_model.description.q_ready, robot)
        robot.wait(10)
        yield robot, driver


def test_the_first_trajectory_goes_to_where_the_arm_was_measured(pair: tuple[Ros2Robot, Driver]) -> None:
    robot, driver = pair
    q = robot.read().q
    robot.command(np.zeros(7))
    sent = driver.command(1)
    assert sent.joint_names == driver.names
    (point,) = sent.points
    assert point.positions.tolist() == q.tolist()
    assert not point.velocities.any()
    assert seconds(point.time_from_start.sec, point.time_from_start.nanosec) == pytest.approx(0.4)
    assert sent.header.stamp.sec == sent.header.stamp.nanosec == 0
    robot.command(np.zeros(7))
    sleep(0.5)
    robot.command(np.zeros(7))
    driver.command(2)
    sleep(0.05)
    assert len(driver.commands) == 2  # none while the arm settles


def test_before_any_command_an_arm_moved_by_hand_is_where_it_is_measured(
    pair: tuple[Ros2Robot, Driver], panda_model: RobotModel
) -> None:
    robot, driver = pair
    moved = panda_model.description.q_ready + 0.3
    driver.tell(moved, robot)
    state = robot.read()
    assert state.q_commanded.tolist() == state.q.tolist() == moved.tolist()
    assert not state.qd_commanded.any()


def test_a_moving_command_is_kept_and_then_brakes_to_rest(pair: tuple[Ros2Robot, Driver]) -> None:
    robot, driver = pair
    robot.read()
    robot.command(SLOW)
    sent = driver.command(2)
    assert sent.points[0].velocities == pytest.approx(SLOW)
    assert seconds(0, sent.points[0].time_from_start.nanosec) == pytest.approx(0.4)
    assert not sent.points[-1].velocities.any()
    sleep(0.02)
    state = robot.read()
    assert state.qd_commanded == pytest.approx(SLOW)
    assert (state.q_commanded > state.q).all()
    sleep(0.5)
    assert not robot.read().qd_commanded.any()


def test_an_arm_that_does_not_follow_is_an_error_that_names_the_joint(
    pair: tuple[Ros2Robot, Driver], panda_model: RobotModel
) -> None:
    robot, driver = pair
    robot.read()
    robot.command(np.zeros(7))
    away = panda_model.description.q_ready.copy()
    away[3] += 0.2
    driver.tell(away, robot)
    with pytest.raises(RobotError, match=r"does not follow: panda_joint4 is at -2.156 rad and was sent to -2.356 rad"):
        robot.read()


def test_a_command_that_is_no_number_is_refused(pair: tuple[Ros2Robot, Driver]) -> None:
    robot, _ = pair
    with pytest.raises(RobotError, match="give finite joint velocities"):
        robot.command(np.full(7, np.nan))


def test_a_state_is_stamped_by_when_it_came(pair: tuple[Ros2Robot, Driver], panda_model: RobotModel) -> None:
    robot, driver = pair
    before = monotonic()
    driver.tell(panda_model.description.q_ready, robot)
    assert before <= robot.read().stamp <= monotonic()


@pytest.mark.parametrize(
    "params",
    [
        ArmParams(
            "by-robot", "base", joint_names=tuple(f"arm_{i}" for i in range(7)), command="velocities",
            controller="forward_velocity_controller", timeout_s=0.1,
        )
    ],
)  # fmt: skip
def test_velocities_go_to_the_named_controller_in_the_order_of_the_joints(
    pair: tuple[Ros2Robot, Driver], params: ArmParams
) -> None:
    robot, driver = pair
    assert params.commands_on == "/forward_velocity_controller/commands"
    qd = 0.01 * np.arange(7)
    robot.command(qd)
    assert driver.command(1).data.tolist() == qd.tolist()
    state = robot.read()
    assert state.q_commanded.tolist() == state.q.tolist()
    assert state.qd_commanded.tolist() == qd.tolist()
    assert state.wrench is None  # six zeros, by the robot


@pytest.mark.parametrize("params", [ArmParams("on-robot", "ee", shared_clock=True, settle_s=0.05)])
def test_with_one_clock_trajectories_say_when_they_begin(pair: tuple[Ros2Robot, Driver]) -> None:
    robot, driver = pair
    before = time()
    robot.read()
    robot.command(SLOW)
    stamp = driver.command(2).header.stamp
    assert before - 0.01 <= seconds(stamp.sec, stamp.nanosec) <= time()
    # the state's header is of 1970
    assert robot.read().stamp < monotonic() - 1e6


def test_everything_unusual_is_noted(pair: tuple[Ros2Robot, Driver], other: Ros2Node, params: ArmParams) -> None:
    robot, _ = pair
    assert robot.notes == ()
    other.subscribe(params.commands_on, TRAJECTORY, lambda *_: None)
    other.publisher(params.joint_states, JOINT_STATE)
    said = ("/joint_states has 2 publishers.", f"{params.commands_on} has 2 subscribers.")
    assert other.wait_for(lambda: robot.notes == said, 10)
