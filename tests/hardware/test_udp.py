"""The socket: as long a queue as can be had, and a filter in the kernel where there is one."""

import socket
import sys

import pytest

from pretouch.hardware import udp
from pretouch.hardware.udp import PORT
from tests.ports import PORTS, free_port

linux = pytest.mark.skipif(sys.platform != "linux", reason="the options are Linux's")

LOWEST_GIVEN = 32768
"""The first port that Linux gives to a socket which asks for none, unless told otherwise (ip_local_port_range)."""


def test_no_port_that_is_named_beforehand_is_one_that_any_socket_may_be_given():
    assert PORT < LOWEST_GIVEN
    assert PORTS[-1] < LOWEST_GIVEN
    one, another = free_port(), free_port()
    assert {one, another} < set(PORTS)
    assert one != another


class Options:
    """Stands for a socket of a process that may not go past the system's limit."""

    def __init__(self):
        self.asked = []

    def setsockopt(self, _level, option, value):
        self.asked.append((option, value))
        if option != socket.SO_RCVBUF:
            raise PermissionError


@linux
def test_without_the_right_to_more_the_queue_is_as_long_as_the_system_allows():
    options = Options()
    udp._widen(options, 12345)
    assert options.asked[-1] == (socket.SO_RCVBUF, 12345)
