"""What tyro says, in our words: one sentence for what is wrong with a command line, and help as wide as a terminal."""

import re
from collections.abc import Sequence
from textwrap import wrap

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
    if found := re.match(r"Missing from (.*?): (--\S+ )?(?:\[.*?\]\]|\S+) (.*?) ?\(required\)", said):
        return f"{found[1]} lacks {(found[2] or 'an argument').strip()}: {found[3].rstrip('.')}. See {found[1]} --help."
    return f"{said.rstrip('.')}.{end}"


_OPTION = re.compile(r"  (?P<name>[-\[{A-Z]\S*(?: \S+)*)(?:  +(?P<said>\S.*))?")
_NOTHING = re.compile(r" ?\(default: (?:''|None)?\)")


def tidied(text: str, width: int) -> str:
    """Return a command's help with its sentences wrapped anew: without the source's line ends and empty defaults."""
    parts: list[list[str]] = []
    for line in map(str.rstrip, text.rstrip().splitlines()):
        joined = line.startswith("      ") if parts and _OPTION.fullmatch(parts[-1][0]) else line[:1].strip()
        if parts and parts[-1][0] and joined:
            parts[-1].append(line)
        else:
            parts.append([line])
    return "\n".join(line for part in parts for line in _wrapped(part, width)) + "\n"


def _wrapped(lines: list[str], width: int) -> list[str]:
    """Return the lines of an option, its name and beside or below it what it is, or of a paragraph."""
    found = _OPTION.fullmatch(lines[0])
    if found is None:
        return lines if lines[0].startswith(" ") else wrap(" ".join(lines), width) or [""]
    beside = found["said"] is not None
    if not beside and not lines[1:]:
        return lines
    column = found.start("said") if beside else len(lines[1]) - len(lines[1].lstrip())
    said = _NOTHING.sub("", " ".join((found["said"] or "", *map(str.strip, lines[1:]))).strip())
    below = [" " * column + line for line in wrap(said, max(width - column, 20))]
    return [lines[0][:column] + below[0].lstrip(), *below[1:]] if beside else [lines[0], *below]


def _value(option: str, args: Sequence[str]) -> str:
    """Return what was given to an option."""
    for i, word in enumerate(args):
        name, given, text = word.partition("=")
        if name.replace("_", "-") == option:
            return repr(text if given else " ".join(args[i + 1 : i + 2]))
    return "not what it takes"
