"""A person at the terminal while the arm moves."""

import os
import pty
import threading

from pretouch.session.terminal import BackgroundPrinter, EnterKey


def test_enter_is_heard_once_and_other_keys_are_not_and_a_terminal_that_goes_away_raises_nothing():
    ours, theirs = pty.openpty()
    enter = EnterKey(theirs)
    assert enter.possible
    assert not enter()
    os.write(ours, b"abc\n")
    assert any(enter() for _ in range(10_000))
    assert not enter()
    for side in (ours, theirs):
        os.close(side)
        assert not enter()


def test_without_a_terminal_nobody_presses_enter(tmp_path):
    with (tmp_path / "input").open("w+") as file:
        file.write("\n")
        file.seek(0)
        enter = EnterKey(file.fileno())
        assert not enter.possible
        assert not enter()


def test_a_terminal_that_takes_nothing_does_not_keep_the_caller_waiting():
    free, said = threading.Event(), []

    def say(sentence):
        free.wait()
        said.append(sentence)

    with BackgroundPrinter(say) as tell:
        for k in range(1000):
            tell(str(k))
        assert not said
        free.set()
    assert said == [str(k) for k in range(1000)]


def test_a_terminal_that_is_gone_ends_nothing():
    def say(_):
        raise BrokenPipeError

    with BackgroundPrinter(say) as tell:
        tell("a")
        tell("b")
