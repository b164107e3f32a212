"""Table of all commands: the product's, those of its other distributions, and those of entry points.

A command is a dataclass whose docstrings are the help and whose `run()` does it. `run()` returns the exit code; with
None it is 0, or that of the signal which ended the command. Where its options depend on what its first word names,
`of_words(words)` returns the class, the words that are left, and those in front of them.
"""

from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any, Protocol, cast

from pretouch import extras, plugins
from pretouch.errors import PluginError

GROUP = "pretouch.commands"
"""Entry points of commands that other distributions add."""
COMMANDS: dict[str, dict[str, tuple[str, str]]] = {
    "Begin with": {
        "live": ("live:Live", "a simulated arm in your browser: reach for it"),
        "demo": (extras.LAB, "the paper's three experiments in small"),
        "run": ("run.command:Run", "move an arm: simulated, Franka, or over ROS 2"),
    },
    "Recordings": {
        "replay": ("replay:Replay", "view, recompute, or compare with another profile"),
        "report": ("report:WriteReport", "contacts, forces and distances as one page"),
        "detect": ("detect:Detect", "try the contact thresholds on data of your own arm"),
    },
    "Sensor units": {
        "skin monitor": ("skin_monitor:Monitor", "watch units: rates, losses, batteries, faults"),
        "skin check-unit": ("skin_check:CheckUnit", "with a card: bursts, delay, order of zones"),
        "skin calibrate": ("calibrate:Calibrate", "find where units sit, from a motion"),
        "skin coverage": ("skin_coverage:MeasureCoverage", "what units see in time, where more help"),
        "skin import": ("robot:ImportSkin", "units of a URDF, or of a table of poses"),
        "skin simulate": ("skin_check:Simulate", "send what real units send"),
        "skin provision": ("skin_keys:Provision", "set up a unit over USB"),
        "skin keys": ("skin_keys:ListKeys", "list, add or revoke the keys of units"),
    },
    "Arm": {
        "robot import": ("robot:ImportArm", "your own arm, from URDF or MJCF"),
        "identify": (extras.LAB, "offsets, friction and noise of an arm"),
        "serve-fci": (extras.FCI, "a simulated Franka for programs that use libfranka"),
    },
    "Experiments": {
        "reproduce": (extras.LAB, "the paper in full, and studies of its claims"),
        "figure": (extras.LAB, "one figure of the paper"),
        "bench": (extras.LAB, "compare detectors, avoidance, forces, step times"),
        "sweep": (extras.LAB, "vary parameters, and see which matter"),
    },
    "Setup": {"warm-up": ("warm_up:WarmUp", "compile, once after an installation")},
}
"""Groups of commands: module and class in `pretouch.cli`, or the distribution that has it; and what it is for.

A table, because a look at all installed distributions takes time.
"""
_PLACES = {name: place for group in COMMANDS.values() for name, (place, _) in group.items()}
OWN = tuple(name for name, place in _PLACES.items() if ":" in place)
"""Commands of the product."""


class Command(Protocol):
    """Options of a command."""

    def run(self) -> int | None:
        """Run the command; return the exit code, or None."""


def commands_of(distribution: str) -> tuple[str, ...]:
    """Return the names of the commands that a distribution of this project adds to the product."""
    return tuple(name for name, place in _PLACES.items() if place == distribution)


def command_class(name: str) -> type[Command] | None:
    """Return the class of a command, None for a word that is none.

    Raises PluginError for a command of a distribution beside this one that is not installed, and for one that cannot
    be loaded.
    """
    place = _PLACES.get(name, "")
    module, colon, member = place.partition(":")
    if colon:
        return cast(type[Command], getattr(import_module(f"pretouch.cli.{module}"), member))
    if name in plugins.names(GROUP):
        added: Any = plugins.load(GROUP, name)
        if not isinstance(added, type) or not callable(getattr(added, "run", None)):
            raise PluginError(
                f"The entry point of the command {name!r} is not a class with run(): uninstall the distribution that"
                " provides it, or correct it."
            )
        return added
    if place:
        raise PluginError(
            f"`pretouch {name}` is a command of {place}, which is not installed: run {extras.install_command(place)}"
        )
    return None


def command_names() -> tuple[str, ...]:
    """Return the names of all commands that are installed: the product's, the other distributions' of ours, others."""
    added = plugins.names(GROUP)
    return (*(name for name in _PLACES if name in OWN or name in added), *(n for n in added if n not in _PLACES))


def split_name(words: Sequence[str], names: Iterable[str]) -> tuple[str, Sequence[str]]:
    """Return the name of the command that words begin with, and the other words; without one, the first word."""
    for length in (2, 1):
        name = " ".join(words[:length])
        if name in names or name in _PLACES:
            return name, words[length:]
    return (words[0] if words else ""), words[1:]


def overview(names: Iterable[str], first_lines: dict[str, str]) -> str:
    """Return the help on some commands, a line of 80 columns each; those in no group have a line of their own."""
    lines = ["usage: pretouch COMMAND [--help ...]"]
    groups = {title: {n: line for n, (_, line) in group.items() if n in names} for title, group in COMMANDS.items()}
    for title, group in (groups | {"Added": first_lines}).items():
        for i, (name, line) in enumerate(group.items()):
            lines.append(f"{'' if i else title:<13} {name:<15} {line}"[:80])
    return "\n".join(lines)
