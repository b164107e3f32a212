"""Reading of TOML files."""

import tomllib
from pathlib import Path
from typing import Any


def read_toml(path: Path) -> dict[str, Any]:
    """Return the table of a TOML file. Raises OSError, and ValueError for what is not TOML or not UTF-8."""
    return parse_toml(path.read_bytes())


def parse_toml(data: bytes) -> dict[str, Any]:
    """Return the table that the bytes of a TOML file hold. Raises ValueError as `read_toml` does."""
    try:
        return tomllib.loads(data.decode())
    except RecursionError as error:
        raise ValueError("its brackets are nested too deeply") from error
