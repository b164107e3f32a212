"""Reading of TOML files."""

import tomllib
from pathlib import Path
from typing import Any

from pretouch.errors import PretouchError


def table_of(path: Path, kind: str, error: type[PretouchError], way_out: str = "") -> dict[str, Any]:
    """Return the table of a TOML file. What keeps it from being read is an error that names its kind, and a way out."""
    try:
        return parse_toml(path.read_bytes())
    except OSError as reason:
        sentence = f"The {kind} {path} cannot be read: {reason.strerror or reason}"
        raise error(f"{sentence}: {way_out}." if way_out else f"{sentence}.") from reason
    except UnicodeDecodeError as reason:
        raise error(f"The {kind} {path} is not UTF-8 text: {reason.reason} at byte {reason.start}.") from reason
    except ValueError as reason:  # not TOML, an integer too long, brackets too deep
        raise error(f"The {kind} {path} is not valid TOML: {reason}.") from reason


def shown(value: Any) -> str:
    """Show a value in a message, cut where it is long. An integer may have more digits than Python writes out."""
    try:
        text = repr(value)
    except ValueError:
        return "too long to show"
    return text if len(text) <= 200 else f"{text[:200]} ..."


def parse_toml(data: bytes) -> dict[str, Any]:
    """Return the table that the bytes of a TOML file hold. Raises ValueError for what is not TOML or not UTF-8."""
    try:
        return tomllib.loads(data.decode())
    except RecursionError as error:
        raise ValueError("its brackets are nested too deeply") from error
