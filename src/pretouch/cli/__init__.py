"""The command `pretouch`."""

import sys
from collections.abc import Sequence
from typing import Annotated, Any, Union

import tyro
from rich.console import Console

from pretouch.cli.registry import Command, check_moved, command_class, command_names
from pretouch.errors import PluginError, PretouchError
from pretouch.signals import Terminated, ends_raise, exit_code

# the rest of the package takes a second to import: only the commands that run something do

_USAGE, _INTERRUPTED = 2, 130
_CONFIG = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes)


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code: 2 for bad input, 130, 143 or 129 after Ctrl-C, SIGTERM or SIGHUP."""
    errors = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        with ends_raise():
            code = _read(sys.argv[1:] if args is None else args, errors).run()
    except PretouchError as error:
        errors.print(str(error), markup=False)
        return _USAGE
    except (KeyboardInterrupt, Terminated):
        return exit_code() or _INTERRUPTED
    return exit_code() if code is None else code


def _read(args: Sequence[str], errors: Console) -> Command:
    """Return the command that words say. With a command's name first, no other command is loaded."""
    check_moved(args)
    name = args[0] if args else ""
    wanted: Any = None if name.startswith("-") else command_class(name)
    if wanted is not None:
        return tyro.cli(wanted, prog=f"pretouch {name}", args=args[1:], config=_CONFIG)
    # help on all of them, or words that are none: tyro says which there are
    known: list[Any] = []
    for each in command_names():
        try:
            known.append(Annotated[command_class(each), tyro.conf.subcommand(each)])
        except PluginError as error:
            errors.print(str(error), markup=False)
    every: Any = Union[tuple(known)]  # noqa: UP007  # made when it is asked for
    return tyro.cli(every, prog="pretouch", description="Contact-anticipating robot arms.", args=args, config=_CONFIG)
