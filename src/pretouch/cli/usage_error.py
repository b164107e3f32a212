"""What is wrong with the words of a command line, as one sentence in place of the boxes that tyro draws."""

import re
from collections.abc import Sequence

_BORDER = re.compile(r"^[╭╰│+|]|[╮╯│+|]$")
_RULE = re.compile(r"^\s*[-─]{3,}\s*$", re.MULTILINE)
_KINDS = {"INT": "a whole number", "FLOAT": "a number"}


def usage_error(boxed: str, args: Sequence[str], prog: str) -> str:
    """Return the sentence: the option, its value and what is accepted, as far as tyro says.

    Args:
        boxed: what tyro wrote.
        args: the words of the command.
        prog: the command.
    """
    lines = [_BORDER.sub("", line.strip()) for line in boxed.splitlines()][1:]  # the first is a title
    sections = [" ".join(part.split()) for part in _RULE.split("\n".join(lines)) if part.strip()]
    said, more = sections[0], " ".join(sections[1:])
    end = f" See {prog} --help."
    if found := re.match(r"Error parsing (\S+): ", said):
        option = found[1]
        kind = re.search(rf"{re.escape(option)} (\S+)", more)
        accepted = kind[1].removeprefix("{None}|") if kind else ""
        return f"{option} is {_value(option, args)}: give {_KINDS.get(accepted, accepted or 'another value')}.{end}"
    if found := re.match(r"invalid choice (.*) for argument '(.*)'\. Expected one of \((.*?),?\)", said):
        choices = ", ".join(word or "''" for word in re.findall(r"'([^']*)'", found[3]))
        return f"{found[2]} is {found[1]}: choose from {choices}.{end}"
    if found := re.match(r"Missing value for argument '(.*)'\. Expected (\d+)", said):
        return f"{found[1]} lacks a value: give {found[2]}.{end}"
    if found := re.match(r"Unrecognized options: (.*)", said):
        word = found[1].split(",")[0]
        meant = re.findall(r"(--[\w-]+) ", more.partition("Perhaps you meant:")[2].partition("For full")[0])
        known = re.search(r"Available subcommands: ([\w, -]+?) (?:For|$)", more)
        near = f"perhaps {' or '.join(dict.fromkeys(meant))}" if meant else f"choose from {known[1]}" if known else ""
        return f"{word} is unknown{': ' if near else ''}{near}.{end}"
    if found := re.match(r"Missing from (.*?): (?:\[.*?\]\]|\S+) (.*?) ?\(required\)", said):
        return f"{found[1]} lacks an argument: {found[2].rstrip('.')}. See {found[1]} --help."
    return f"{said.rstrip('.')}.{end}"


def _value(option: str, args: Sequence[str]) -> str:
    """Return what was given to an option."""
    for i, word in enumerate(args):
        name, given, text = word.partition("=")
        if name.replace("_", "-") == option:
            return repr(text if given else " ".join(args[i + 1 : i + 2]))
    return "not what it takes"
