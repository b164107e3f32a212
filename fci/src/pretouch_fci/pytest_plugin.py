"""The pytest fixture `franka_server`; loaded by pytest alone, in every run, so it imports nothing else before its use.

PYTEST_DONT_REWRITE: there is no assertion in it.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pretouch_fci.testing import FrankaServer


@pytest.fixture
def franka_server() -> "Iterator[Callable[..., FrankaServer]]":
    """Make simulated Frankas, by `franka_server(robot="fr3", scene="static")`; they end with the test.

    Options are those of `pretouch serve-fci`; see `pretouch_fci.testing.FrankaServer`. What the server said is with the
    report of a test that fails.
    """
    from pretouch_fci.testing import FrankaServer

    servers: list[FrankaServer] = []
    with ExitStack() as running:

        def start(**options: object) -> FrankaServer:
            servers.append(running.enter_context(FrankaServer(**options)))  # type: ignore[arg-type]
            return servers[-1]

        yield start
    for server in servers:
        print(f"{server.host}:", *server.said, sep="\n  ")
