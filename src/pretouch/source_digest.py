"""The digest of the source text that a function rests on: its module, and all that this module imports.

What is compiled is kept under it, and a recording names it. The text is read, nothing is imported. Followed are the
package `pretouch` and that of the function itself; what they need of others is told by versions.
"""

import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path

from pretouch.errors import SourceError

_COMMENT = re.compile(r"#.*")
_IMPORT = re.compile(r"(?:^|;)[ \t]*(?:from\s+([\w.]+)\s+)?import\s+(\([^)]*\)|(?:\\\n|.)*)", re.MULTILINE)
"""The module that names are imported from, if one is given, and the names. Parsing would take 15 times as long; what a
docstring seems to import is followed too, and only makes the digest change more often."""


def source_digest(function: Callable[..., object]) -> str:
    """Return what tells this state of the source text that a function or class rests on from any other.

    A function of a script rests on that file and what it imports of this package. Each file is read once in a process.
    Raises SourceError where the text cannot be found.
    """
    own = function.__module__
    file = getattr(sys.modules.get(own), "__file__", None)
    if file is None or not Path(file).is_file():
        raise SourceError(f"The source text of {function.__qualname__} cannot be found: put it in a file.")
    package = getattr(sys.modules.get(own.partition(".")[0]), "__path__", [])
    above = {__name__.partition(".")[0]: Path(__file__).parents[1]} | {Path(at).name: Path(at).parent for at in package}
    digests: dict[str, str] = {}
    todo = [(own, Path(file))]
    while todo:
        name, place = todo.pop()
        if name not in digests:
            digests[name], needed = _read(name, place, tuple(above.items()))
            todo += needed
    return sha256(repr(sorted(digests.items())).encode()).hexdigest()


@cache
def _read(name: str, place: Path, above: tuple[tuple[str, Path], ...]) -> tuple[str, list[tuple[str, Path]]]:
    """Return the digest of a module, and what it imports of packages, which are given with the folders above them."""
    text, folders, needed = place.read_text(encoding="utf-8"), dict(above), list[tuple[str, Path]]()
    for module in _imported(text, name, place):
        root, _, rest = module.partition(".")
        if root in folders:
            file = _place(module, folders[root]) if rest else None
            if file:
                needed.append((module, file))
            elif "." not in rest:  # a package may load what it gives itself from any of its modules
                needed += _modules(root, folders[root])
    return sha256(text.encode()).hexdigest(), needed


def _imported(text: str, name: str, place: Path) -> Iterator[str]:
    """Find the names of all modules that a module's text imports, and names that may be modules."""
    parts = name.split(".") if place.name == "__init__.py" else name.split(".")[:-1]
    for base, names in _IMPORT.findall(_COMMENT.sub("", text)):
        level = len(base) - len(base.lstrip("."))
        if level:
            base = ".".join([*parts[: len(parts) - level + 1], *filter(None, [base[level:]])])
        if "." in base:
            yield base
        for imported in re.findall(r"[\w.]+", names):
            yield f"{base}.{imported}" if base else imported


@cache
def _place(module: str, above: Path) -> Path | None:
    """Return the file of a module whose package lies in a folder, or None if there is none."""
    place = above.joinpath(*module.split("."))
    return next((file for file in (place / "__init__.py", place.with_suffix(".py")) if file.is_file()), None)


@cache
def _modules(package: str, above: Path) -> list[tuple[str, Path]]:
    """Return all modules of a package that lies in a folder."""
    files = [(file.relative_to(above).with_suffix("").parts, file) for file in (above / package).rglob("*.py")]
    return [(".".join(parts).removesuffix(".__init__"), file) for parts, file in files]
