"""Settings, and what of the environment counts."""

import pytest

from pretouch.errors import ParameterError, RobotError
from pretouch_ros2.network import check_range, domain_of
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams, NodeParams, check_topic


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ArmParams("up", "base"), "ArmParams.sign is 'up': choose one of on-robot, by-robot"),  # type: ignore[arg-type]
        (lambda: ArmParams("on-robot", "base", joint_states="joint_states"), "give the full name of a topic"),
        (lambda: ArmParams("on-robot", "base", wrench="/a//b"), "give the full name of a topic"),
        (lambda: ArmParams("on-robot", "base", torques="tau"), "give the full name of a topic"),
        (lambda: ArmParams("on-robot", "base", command_topic="/1st"), "give the full name of a topic"),
        (lambda: ArmParams("on-robot", "base", joint_names=("a", "a")), "name each joint once"),
        (lambda: ArmParams("on-robot", "base", follow_most_rad=100.0), "must be at most 0.3"),
        (lambda: ArmParams("on-robot", "base", settle_s=1e-6), "must be at least 0.2"),
        (lambda: ArmParams("on-robot", "base", wrench_timeout_s=1e5), "must be at most 0.5"),
        (lambda: ArmParams("on-robot", "base", ahead_s=0.1), "must be at most 0.05"),
        (lambda: check_topic("Ros2Skin", "topic", "/skin/u/range here"), "give the full name of a topic"),
        (lambda: NodeParams(interface="lo; rm"), "give an address or name of an interface"),
        (lambda: NodeParams(domain=233), "must be at most 232"),
        (lambda: NodeParams("lunar"), "choose one of foxy"),  # type: ignore[arg-type]
    ],
)
def test_a_setting_that_cannot_be_is_refused_with_the_way_out(make, said):
    with pytest.raises(ParameterError, match=said):
        make()


def test_sign_and_frame_have_no_default():
    with pytest.raises(TypeError, match="'sign' and 'frame'"):
        ArmParams()  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("domain", "environment", "expected"),
    [(-1, {}, 0), (-1, {"ROS_DOMAIN_ID": "42"}, 42), (7, {"ROS_DOMAIN_ID": "42"}, 7)],
)
def test_the_domain_is_the_set_one_or_that_of_the_environment(domain, environment, expected):
    assert domain_of(NodeParams(domain=domain), environment) == expected


@pytest.mark.parametrize("text", ["-1", "x", "233", "1.5"])
def test_a_domain_of_the_environment_that_is_none_is_refused(text):
    with pytest.raises(RobotError, match=r"ROS_DOMAIN_ID is .*: set it to a whole number from 0 to 232"):
        domain_of(NodeParams(), {"ROS_DOMAIN_ID": text})


@pytest.mark.parametrize(
    ("environment", "interface", "refused"),
    [
        ({}, "eth0", False),
        ({"ROS_LOCALHOST_ONLY": "1"}, "eth0", True),
        ({"ROS_LOCALHOST_ONLY": "1"}, "127.0.0.1", False),
        ({"ROS_LOCALHOST_ONLY": "0"}, "eth0", False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, "eth0", True),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "eth0", False),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, "127.0.0.1", True),
    ],
)
def test_a_network_that_the_environment_forbids_is_refused(environment, interface, refused):
    params = NodeParams(interface=interface)
    if refused:
        with pytest.raises(RobotError, match="ROS_"):
            check_range(params, environment)
    else:
        check_range(params, environment)


def test_an_interface_that_is_not_there_is_refused(domain):
    with pytest.raises(RobotError, match="cannot be joined through the interface 'nowhere0': give the address or name"):
        Ros2Node(NodeParams(domain=domain + 100, interface="nowhere0"))  # a domain that no node of this process is in


def test_two_nodes_of_a_program_share_a_domain_and_so_its_network(domain):
    with Ros2Node(NodeParams(domain=domain)), Ros2Node(NodeParams(domain=domain)):
        pass
    with pytest.raises(RobotError, match="was joined by this program with another interface"):
        Ros2Node(NodeParams(domain=domain, interface="eth0"))
