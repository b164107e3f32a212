"""All commands: the product's own, and those that other distributions add in the group `pretouch.commands`.

A command is a dataclass whose docstrings are the help and whose `run()` does it. `run()` returns the exit code; with
None it is 0, or that of the signal which ended the command. Where its options depend on what its first word names,
`of_words(words)` returns the class, the words that are left, and those in front of them, and `of_all()` one for all.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol, cast

from pretouch import extras, plugins
from pretouch.errors import PluginError

GROUP = "pretouch.commands"
OWN = {
    "live": "pretouch.cli.commands:Live",
    "replay": "pretouch.cli.commands:Replay",
    "detect": "pretouch.cli.commands:Detect",
    "report": "pretouch.cli.commands:Report",
    "skin": "pretouch.cli.skin_commands:Skin",
    "warm-up": "pretouch.cli.commands:WarmUp",
    "robot": "pretouch.cli.robot_commands:Robot",
    "run": "pretouch.cli.run.options:Run",
}
"""Class of each command of the product: a table, because a look at all installed distributions takes time."""
LAB = ("demo", "reproduce", "figure", "bench", "sweep", "identify")
"""Commands of the distribution pretouch-lab."""
FCI = ("serve-fci",)
"""Commands of the distribution pretouch-fci."""

MOVED = {
    ("skin", "calibrate", "--simulate"): "`pretouch skin calibrate --simulate` is `pretouch bench calibration` now:"
    " the other options are the same, without --simulate.",
}
"""Where to find what was said with two words and an option."""


class Command(Protocol):
    """What was said on the command line."""

    def run(self) -> int | None:
        """Do it; return the exit code, or None."""


def check_moved(args: Sequence[str]) -> None:
    """Raise PluginError, with the new name, for words that have another name now."""
    for (*words, option), sentence in MOVED.items():
        if list(args[: len(words)]) == words and option in args:
            raise PluginError(sentence)


def command_class(name: str) -> type[Command] | None:
    """Return the class of a command, None for a word that is none.

    Raises PluginError for a command of a distribution beside this one that is not installed, and for one that cannot
    be loaded.
    """
    if name in OWN:
        module, _, of_it = OWN[name].partition(":")
        return cast(type[Command], getattr(import_module(module), of_it))
    if name in plugins.names(GROUP):
        found: Any = plugins.load(GROUP, name)
        if not isinstance(found, type) or not callable(getattr(found, "run", None)):
            raise PluginError(
                f"The entry point of the command {name!r} is not a class with run(): uninstall the distribution that"
                " provides it, or correct it."
            )
        return found
    for owner, commands in ((extras.LAB, LAB), (extras.FCI, FCI)):
        if name in commands:
            raise PluginError(
                f"`pretouch {name}` is a command of {owner}, which is not installed:"
                f" run {extras.install_command(owner)}"
            )
    return None


def command_names() -> tuple[str, ...]:
    """Return the names of all commands that are installed: the product's, the other distributions' of ours, others."""
    added = set(plugins.names(GROUP)) - set(OWN)
    return (*OWN, *(name for name in (*FCI, *LAB) if name in added), *sorted(added - {*FCI, *LAB}))
