"""The command `pretouch`."""

import os
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, cast

import tyro
from rich.console import Console

from pretouch.cli.app import COMMANDS, Command, command_class, command_names, overview, split_name
from pretouch.cli.options import REGISTRY
from pretouch.errors import PluginError, PretouchError
from pretouch.signals import Terminated, ends_raise, exit_code

# a command's module takes up to a second to import: of all commands, only the one that is named is loaded

_USAGE, _INTERRUPTED, _PIPE = 2, 130, 141
_CONFIG = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes)


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code: 2 for bad input, 130, 143 or 129 after Ctrl-C, SIGTERM or SIGHUP."""
    errors = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        words = sys.argv[1:] if args is None else args
        with ends_raise():
            try:
                command = _read(words, errors)
                code = command.run()
            finally:
                sys.stdout.flush()  # help ends in SystemExit: a closed pipe is noticed here, not when Python ends
    except PretouchError as error:
        errors.print(str(error), markup=False)
        return _USAGE
    except BrokenPipeError:  # the reader of a pipe has seen enough, as `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _PIPE
    except (KeyboardInterrupt, Terminated):
        return exit_code() or _INTERRUPTED
    return exit_code() if code is None else code


def _read(args: Sequence[str], errors: Console) -> Command:
    """Return the command that words name. With a command's name first, no other command is loaded."""
    names = command_names()
    name, words = split_name(args, names)
    kind: Any = None if name.startswith("-") else command_class(name)
    if kind is not None:
        if hasattr(kind, "of_words"):  # its options depend on what the first words name
            kind, words, name = kind.of_words(words)
        return cast(Command, tyro.cli(kind, prog=f"pretouch {name}", args=words, config=_CONFIG, registry=REGISTRY))
    below = [each for each in names if each.startswith(f"{name} ")]
    if name in ("", "-h", "--help") or (below and (not words or words[0] in ("-h", "--help"))):
        listed = below or names
        grouped = {each for group in COMMANDS.values() for each in group}
        added = _loaded([each for each in listed if each not in grouped], errors)
        first_lines = {each: (kind.__doc__ or "").strip().partition("\n")[0] for each, kind in added.items()}
        print(overview(listed, first_lines))
        raise SystemExit(0 if args and args[-1].startswith("-") else _USAGE)
    near = get_close_matches(name, names, 1)
    advice = f"perhaps {near[0]}" if near else "pretouch --help lists them"
    raise PluginError(
        f"{' '.join(args[:2])} is no command of pretouch: choose from {', '.join(below)}."
        if below
        else f"{name} is no command of pretouch: {advice}."
    )


def _loaded(names: Sequence[str], errors: Console) -> dict[str, Any]:
    """Return the class of each of some commands that can be loaded; what keeps another from it is printed."""
    kinds: dict[str, Any] = {}
    for each in names:
        try:
            kinds[each] = command_class(each)
        except PluginError as error:
            errors.print(str(error), markup=False)
    return kinds
