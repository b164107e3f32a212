"""Signals that end a command, and those that come while an arm moves."""

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

from pretouch.signals import Terminated, ended, ends_raise, exit_code, kept_from_children, noted_in_motion


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
    with ends_raise():
        assert not ended(), "another command begins without them"
    assert exit_code() == 0


def test_the_first_signal_is_raised_at_the_end_and_the_others_are_not():
    noted = []

    def moved():
        with noted_in_motion() as came:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGTERM)
            noted.extend(came)

    with pytest.raises(KeyboardInterrupt):
        moved()
    assert noted == [signal.SIGINT, signal.SIGTERM]


def test_what_was_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with noted_in_motion() as came:
            os.kill(os.getpid(), signal.SIGHUP)
        assert not came
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_child_survives_a_terminal_that_closes_and_ends_by_sigterm():
    with kept_from_children():
        child = subprocess.Popen([sys.executable, "-c", "print(flush=True); input()"], stdout=-1, stdin=-1)
    child.stdout.readline()
    for number in (signal.SIGHUP, signal.SIGTSTP):
        child.send_signal(number)
    child.communicate(b"\n", timeout=20.0)
    assert child.returncode == 0
    assert signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
