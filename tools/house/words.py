"""Finds names and docstrings that a reader of the field has to read twice: `make lint` fails if there is one.

A variable, parameter or field is named by a noun of the field, not by a participle. A docstring names its thing first:
"Distance to the nearest obstacle", not "What is near".
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from tools.house.source import PARTICIPLES

ROOT = Path(__file__).parents[2]
_FOLDERS = ("src", "fci/src", "ros2/src", "lab/src", "tools")

NAMES = PARTICIPLES | {"gone", "heard", "judged", "meant", "met", "seen"}
"""Participles that describe what was done to a value, instead of the value."""
BEGINNINGS = frozenset({"Of", "What", "Whether", "Whom"})
"""First words of docstrings whose sentence has its noun late or lacks one."""

STORED = frozenset(
    {
        ("src/pretouch/inputs.py", "heard"),
        ("src/pretouch/contact/repeated_contact.py", "met"),
        ("src/pretouch/contact/repeated_contact.py", "seen"),
        ("src/pretouch/contact/residual_model.py", "seen"),
    }
)
"""Fields whose names are in recordings and in files of models."""


def hard_words(tree: ast.AST, allowed: frozenset[str] = frozenset()) -> Iterator[tuple[int, str]]:
    """Yield line and sentence of each name, except allowed ones, and of each docstring to rewrite."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name) | ast.Attribute(attr=name, ctx=ast.Store()):
                if name.strip("_") in NAMES - allowed:
                    yield node.lineno, f"{name} is a participle: name the value by a noun of the field"
            case ast.Expr(value=ast.Constant(value=str(text))):
                first = text.partition(" ")[0]
                if first in BEGINNINGS:
                    yield node.lineno, f'a docstring begins with "{first}": begin with the thing itself'


def main(root: Path = ROOT) -> int:
    """Print such places, and return 1 if there are any."""
    places = list[str]()
    for path in sorted(path for folder in _FOLDERS for path in (root / folder).rglob("*.py")):
        name = path.relative_to(root).as_posix()
        stored = frozenset(field for file, field in STORED if file == name)
        words = hard_words(ast.parse(path.read_text(encoding="utf-8")), stored)
        places += [f"{name}:{line}: {sentence}" for line, sentence in words]
    print(*places, sep="\n", end="\n" if places else "")
    return int(bool(places))


if __name__ == "__main__":
    sys.exit(main())
