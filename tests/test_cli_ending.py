"""Signals that end a command."""

import os
import signal
from contextlib import suppress

import pytest

from pretouch.signals import Terminated, ended, ends_raise, exit_code


@pytest.mark.parametrize(
    ("number", "raised", "code"),
    [(signal.SIGINT, KeyboardInterrupt, 130), (signal.SIGTERM, Terminated, 143), (signal.SIGHUP, Terminated, 129)],
)
def test_a_signal_is_raised_and_is_known_even_if_what_was_raised_is_swallowed(
    number: int, raised: type[BaseException], code: int
) -> None:
    caught = False
    with ends_raise():
        assert not ended()
        assert exit_code() == 0
        try:
            os.kill(os.getpid(), number)
        except raised:
            caught = True
        assert ended()
    assert caught
    assert exit_code() == code


def test_the_first_signal_gives_the_exit_code_and_handlers_are_put_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with ends_raise():
        for number in (signal.SIGTERM, signal.SIGINT):
            with suppress(Terminated, KeyboardInterrupt):
                os.kill(os.getpid(), number)
    assert exit_code() == 143
    assert signal.getsignal(signal.SIGINT) is before


def test_another_command_begins_without_the_signals_of_the_one_before() -> None:
    with ends_raise(), suppress(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
    with ends_raise():
        assert not ended()
    assert exit_code() == 0
