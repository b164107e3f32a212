"""Words of a command line: several in one option, and the one that names an arm."""

from collections.abc import Sequence
from itertools import pairwise

from pretouch.arms import DEFAULT
from pretouch.errors import UsageError


def words(text: str) -> tuple[str, ...]:
    """Return the words between commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def numbers(option: str, text: str) -> tuple[float, ...]:
    """Return the numbers between commas; what is none is a UsageError."""
    try:
        return tuple(float(word) for word in words(text))
    except ValueError:
        raise UsageError(f"{option} is {text!r}: give numbers, separated by commas.") from None


def split_arm(words: Sequence[str], command: str) -> tuple[str, Sequence[str]]:
    """Return the name of the arm that the words of a command name, the default one where there is none, and the others.

    Raises UsageError for options by which an arm was named before.
    """
    for word, value in pairwise((*words, "NAME")):
        option, given, text = word.partition("=")
        if option == "--robot":
            name = text if given else value
            raise UsageError(f"`--robot {name}` is `pretouch {command} {name}` now, with options of its own.")
        if option.startswith("--ros-"):
            raise UsageError(f"{option} is an option of `pretouch run ros2` now: see pretouch run ros2 --help.")
    if words and not words[0].startswith("-"):
        return words[0], words[1:]
    return DEFAULT, words
