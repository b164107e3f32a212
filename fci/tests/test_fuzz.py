"""Nothing that a client sends is worse than the end of its connection, soon: whole requests are changed at random."""

import socket
import time
from contextlib import suppress

import numpy as np
import pytest
from fci.tests.conftest import arm_of
from hypothesis import HealthCheck, given, settings
from tests.fuzz.mutations import Change, changed, changes

from pretouch_fci.arm import ServedArm
from pretouch_fci.commands import set_or_get, wanted_motion
from pretouch_fci.connections import Connection, Disconnected
from pretouch_fci.wire import PROTOCOLS, Protocol

SOON_S = 10.0
"""Longest time for anything that is read [s]."""
PROTOCOL = PROTOCOLS["panda"]


def _ones(protocol: Protocol, name: str) -> bytes:
    size = protocol.sizes[name]
    return np.ones(size // 8 + 1).tobytes()[:size]


REQUESTS = [
    PROTOCOL.reply(name, k, _ones(PROTOCOL, name))
    for k, name in enumerate(name for name in PROTOCOL.requests if name in PROTOCOL.sizes)
]
WHOLE = b"".join(REQUESTS)


@pytest.fixture(scope="module")
def read():
    """Have an arm take in what a client sends."""
    with arm_of() as arm:

        def taken_in(data: bytes) -> None:
            began = time.monotonic()
            try:
                _serve(arm, data)
            finally:
                arm.forget_settings()
                assert time.monotonic() - began < SOON_S

        yield taken_in


def _serve(arm: ServedArm, data: bytes) -> None:
    ours, theirs = _connected()
    with ours, theirs:
        theirs.sendall(data[:4096])
        for request in Connection(ours, "a client").requests(PROTOCOL):
            if request.name == "Move":
                wanted_motion(PROTOCOL, request.body)
            elif request.name.startswith(("Set", "Get")) and request.name != "GetRobotModel":
                set_or_get(arm, request.name, request.body)
    assert np.all(np.isfinite(arm.frames.F_T_EE))
    assert np.all(np.isfinite(arm.frames.load.inertia))


def _connected() -> tuple[socket.socket, socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        theirs = socket.create_connection(server.getsockname())
        return server.accept()[0], theirs


def test_whole_requests_are_taken_in(read):
    read(WHOLE)
    for request in REQUESTS:
        read(request)


@pytest.mark.slow
def test_whatever_is_changed_is_no_worse_than_the_end_of_the_connection(read):
    @settings(max_examples=200, suppress_health_check=list(HealthCheck))
    @given(changes, changes)
    def fuzzed(first: list[Change], second: list[Change]) -> None:
        data = [WHOLE, *REQUESTS][second[0].number % (1 + len(REQUESTS))]
        with suppress(Disconnected):
            read(changed(data, first, (*REQUESTS, WHOLE[:200])))

    fuzzed()
