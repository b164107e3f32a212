"""The command `pretouch`."""

import os
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Annotated, Any, NoReturn, Union, cast

import tyro
from rich.console import Console

from pretouch.cli.overview import SHELLS, overview
from pretouch.cli.registry import Command, check_moved, command_class, command_names
from pretouch.errors import PluginError, PretouchError, UsageError
from pretouch.signals import Terminated, ends_raise, exit_code

# the rest of the package takes a second to import: only the commands that run something do

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
    """Return the command that words say. With a command's name first, no other command is loaded."""
    check_moved(args)
    name = args[0] if args else ""
    wanted: Any = None if name.startswith("-") else command_class(name)
    if wanted is not None:
        words, prog = args[1:], name
        if hasattr(wanted, "of_words"):  # its options depend on what the first words name
            wanted, words, prog = wanted.of_words(words)
        return cast(Command, tyro.cli(wanted, prog=f"pretouch {prog}", args=words, config=_CONFIG))
    if name == "completion":
        _write_completion(args[1:], errors)
    if name in ("", "-h", "--help"):
        print(overview({each: _summary(kind) for each, kind in _every(errors).items()}))
        raise SystemExit(_USAGE if not name else 0)
    near = get_close_matches(name, command_names(), 1)
    raise PluginError(
        f"{name} is no command of pretouch: {f'perhaps {near[0]}' if near else 'pretouch --help lists them'}."
    )


def _every(errors: Console) -> dict[str, Any]:
    """Return the class of each command that can be loaded; what keeps another from it is printed."""
    known: dict[str, Any] = {}
    for each in command_names():
        try:
            known[each] = command_class(each)
        except PluginError as error:
            errors.print(str(error), markup=False)
    return known


def _summary(command: Any) -> str:
    return (command.__doc__ or "").strip().partition("\n")[0]


def _write_completion(shells: Sequence[str], errors: Console) -> NoReturn:
    """Print what a shell needs to complete the words of all commands, and end."""
    if len(shells) != 1 or shells[0] not in SHELLS:
        raise UsageError(f"pretouch completion is for one shell: choose from {', '.join(SHELLS)}.")
    kinds = [
        Annotated[kind.of_all() if hasattr(kind, "of_all") else kind, tyro.conf.subcommand(name)]
        for name, kind in _every(errors).items()
    ]
    every: Any = Union[tuple(kinds)]  # noqa: UP007  # made when it is asked for
    tyro.cli(every, prog="pretouch", args=["--tyro-print-completion", *shells], config=_CONFIG)
    raise SystemExit(0)
