"""Reading of TOML that somebody else may have written, in time and memory that grow no faster than its size."""

import re
import tomllib
from pathlib import Path
from typing import Any

LARGEST_FILE = 2_000_000
"""[bytes] Ours have some 10 kB; a reader takes about a second for so many."""
_DEEPEST_KEY = 20
"""Parts of one dotted key: tomllib keeps each of its beginnings, so that memory grows with the square of this."""

_HIDDEN = re.compile(
    r'''#[^\n]*|"""(?:[^"\\]|\\.|"(?!""))*+(?:"""|\Z)|"(?:[^"\\\n]|\\.)*+"?'''
    r"""|'''(?:[^']|'(?!''))*+(?:'''|\Z)|'[^'\n]*+'?""",
    re.DOTALL,
)
"""Comments and texts, in which a dot parts no key. One that is not closed ends with the line or file: to look into it
again from each quote within would take quadratic time."""
_TOO_DEEP = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_DEEPEST_KEY}}}")
_HEADER = re.compile(r"[ \t]*\[\[[ \t]*([\w-]+)[ \t]*\]\]|[ \t]*\[[ \t]*([\w-]+)[ \t]*\.[ \t]*([\w-]+)[ \t]*\]")


def lines_of(text: str) -> dict[tuple[str, str | int], int]:
    """Return the line of each [name.key] and of each [[name]], the latter by its number from 0 on."""
    found, count = dict[tuple[str, str | int], int](), dict[str, int]()
    for number, line in enumerate(_HIDDEN.sub(_blank, text).split("\n"), 1):
        if header := _HEADER.match(line):
            name, table, key = header.groups()
            if name:
                found[name, count.get(name, 0)] = number
                count[name] = count.get(name, 0) + 1
            else:
                found[table, key] = number
    return found


def _blank(hidden: re.Match[str]) -> str:
    """Keep the line ends of what is left out."""
    return "\n" * hidden.group().count("\n")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file. Raises OSError, and ValueError for what is not TOML, UTF-8 or within the bounds above."""
    return parsed_toml(bytes_of(path))


def bytes_of(path: Path) -> bytes:
    """Return the bytes of a TOML file, at most one more than it may have."""
    with path.open("rb") as file:
        return file.read(LARGEST_FILE + 1)


def parsed_toml(data: bytes) -> dict[str, Any]:
    """Return the table that the bytes of a TOML file hold. Raises ValueError as `read_toml` does."""
    if len(data) > LARGEST_FILE:
        raise ValueError(f"it is larger than {LARGEST_FILE} bytes, so shorten it")
    text = data.decode()
    if _TOO_DEEP.search(_HIDDEN.sub("text", text)):
        raise ValueError(f"a key has more than {_DEEPEST_KEY} parts with dots between them, so nest less")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ValueError("its brackets are nested too deeply") from error
