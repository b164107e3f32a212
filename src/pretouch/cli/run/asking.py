"""What a person at the terminal is told, and asked before an arm moves."""

import sys

from pretouch.errors import RobotError


def say(sentence: str) -> None:
    """Print it at once."""
    print(sentence, flush=True)


def demand_yes(question: str, otherwise: str) -> None:
    """Have a person say yes; a RobotError with `otherwise` if none does."""
    if not sys.stdin.isatty():
        raise RobotError("There is no terminal to ask at whether the arm may move: give --yes.")
    if input(f"{question} [y/N] ").strip().lower() not in ("y", "yes"):
        raise RobotError(f"{otherwise}: answer y to let it.")
