"""Peers that take a connection and say nothing: whoever waits for one gives up with a sentence, within a bound.

Of the others that wait, each has its test beside it: `arms/franka/test_connect` (the arm's process),
`units/test_provision` (a unit's line), `ros2/tests` (topics).
"""

import http.client
import socket
import time
from collections.abc import Iterator

import pytest

from pretouch.page.server import ServeOptions, served
from pretouch.units.skin import NetworkSkin
from tests.ports import free_port
from tests.units.fake_unit import IDS, KEYS


@pytest.fixture(autouse=True)
def bounded() -> Iterator[None]:
    began = time.monotonic()
    yield
    assert time.monotonic() - began < 30.0


def test_units() -> None:
    with NetworkSkin(IDS, KEYS) as skin:
        began = time.monotonic()
        assert not skin.take_samples()
        assert skin.read().stamp.size == len(IDS)
        assert time.monotonic() - began < 1.0


def test_visitors_of_a_page_keep_nobody_else_out() -> None:
    options = ServeOptions(port=free_port())
    place = (options.host, options.port)
    with served(options, "test"):
        mute = [socket.create_connection(place) for _ in range(20)]
        half = [socket.create_connection(place) for _ in range(20)]
        for one in half:
            one.sendall(b"GET / HTTP/1.1\r\n")
        page = http.client.HTTPConnection(*place, timeout=5.0)
        page.request("GET", f"/{options.token}/")
        assert page.getresponse().status == 200
        page.close()
        for one in (*mute, *half):
            one.close()
