"""The socket: as long a queue as can be had, and a filter in the kernel where there is one."""

import socket
import sys
from types import SimpleNamespace

import pytest

from pretouch.units import udp
from pretouch.units.udp import PORT

linux = pytest.mark.skipif(sys.platform != "linux", reason="the options are Linux's")

LOWEST_GIVEN = 32768
"""The first port that Linux gives to a socket which asks for none, unless told otherwise (ip_local_port_range)."""


def test_the_port_of_units_is_none_that_any_socket_may_be_given():
    assert PORT < LOWEST_GIVEN


@linux
def test_without_the_right_to_more_the_queue_is_as_long_as_the_system_allows():
    asked = []

    def set_option(_level, option, value):
        asked.append((option, value))
        if option != socket.SO_RCVBUF:
            raise PermissionError

    udp._widen(SimpleNamespace(setsockopt=set_option), 12345)
    assert asked[-1] == (socket.SO_RCVBUF, 12345)
