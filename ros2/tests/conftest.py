"""What the tests of ROS 2 share: a DDS domain that no other test process of this machine uses."""

import socket

import pytest
from tests.needs import modules_with

from pretouch.extras import ROS2

pytest_pycollect_makemodule = modules_with(ROS2)


@pytest.fixture(scope="session")
def domain():
    """A domain; a name in the kernel, gone with the process, says that it is taken."""
    for number in range(20, 101):  # beyond, its ports are those that the system gives to anybody
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as taken:
            try:
                taken.bind(f"\0pretouch-tests-dds-{number}")
            except OSError:
                continue
            yield number
            return
    pytest.fail("All DDS domains are taken by other tests.")


@pytest.fixture
def node(domain):
    from pretouch_ros2.node import Ros2Node
    from pretouch_ros2.params import NodeParams

    with Ros2Node(NodeParams(domain=domain)) as made:
        yield made


other = third = node


@pytest.fixture
def arm(domain, tmp_path):
    from ros2.tests.arm_peer import arm_peer

    with arm_peer(domain, tmp_path / "log.npy") as peer:
        yield peer
