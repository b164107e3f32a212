"""Signals while an arm moves."""

import os
import signal
import subprocess
import sys

import pytest

from pretouch.signals import children_undisturbed, noted_in_motion


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
    with children_undisturbed():
        child = subprocess.Popen([sys.executable, "-c", "print(flush=True); input()"], stdout=-1, stdin=-1)
    child.stdout.readline()
    for number in (signal.SIGHUP, signal.SIGTSTP):
        child.send_signal(number)
    child.communicate(b"\n", timeout=20.0)
    assert child.returncode == 0
    assert signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
