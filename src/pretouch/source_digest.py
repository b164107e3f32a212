"""The digest of the source text that a function rests on: its module, and all that this module imports.

Results that are kept are keyed by it, compiled functions too. The text is read, nothing is imported. Followed are the
packages `pretouch` and that of the function itself; what they need of others is told by versions.
"""

import ast
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from hashlib import sha256
from pathlib import Path

from pretouch.errors import SourceError

Import = ast.Import | ast.ImportFrom
Seed = str | Path
"""A module by its name, or a file of no package that is followed."""

_NAMED = re.compile(r"""\b(?:import_module|files)\(\s*f?["'](\w[\w.]*)(["'{])""")
"""A module or folder that is named by text, or in an f-string the beginning of such a name."""


class Sources:
    """Source text of some packages, as it was when it was first looked at."""

    def __init__(self, *folders: Path) -> None:
        """Take packages by their folders, whose last part is the package's name."""
        self._modules: dict[str, Path] = {}
        self._data: dict[str, list[Path]] = {}
        for folder in folders:
            self._enter(folder, folder.name, folder.name)
        self._above = {folder.name: folder.parent for folder in folders}
        self._needs = cache(self._find_needs)
        self._lazy = cache(self._find_lazy)
        self._content = cache(self._find_content)

    def digest(self, *seeds: Seed) -> str:
        """Return what tells this state of the seeds' closure from any other. Raises SourceError.

        It covers the text of its modules, and every file of its packages that is no Python: scenarios, skins, models.
        Each counts with its place inside its package.
        """
        files = {file for seed in self.closure(*seeds) for file in self._content(seed)}
        return sha256(repr(sorted(files)).encode()).hexdigest()

    def closure(self, *seeds: Seed) -> set[Seed]:
        """Return all modules of these packages that the seeds' functions may run. Raises SourceError.

        Imports of functions count as those of modules do, and so do the packages that a module lies in. Those for a
        type checker alone do not count.
        """
        found: set[Seed] = set()
        todo = list(seeds)
        while todo:
            seed = todo.pop()
            if seed not in found:
                found.add(seed)
                todo += self._needs(seed)
        return found

    def _enter(self, folder: Path, name: str, owner: str) -> None:
        """Enter the files of a folder: modules by their names, all others under the package that owns the folder."""
        with os.scandir(folder) as found:
            entries = {entry.name: entry for entry in found}
        if "__init__.py" in entries:
            owner = name
        for entry in entries.values():
            path = Path(entry.path)
            if path.name.startswith((".", "__pycache__")) or path.suffix == ".pyc":
                continue
            if entry.is_dir(follow_symlinks=False):
                self._enter(path, f"{name}.{path.name}", owner)
            elif path.suffix == ".py":
                self._modules[name if path.stem == "__init__" else f"{name}.{path.stem}"] = path
            elif entry.is_file():
                self._data.setdefault(owner, []).append(path)

    def _find_needs(self, seed: Seed) -> frozenset[str]:
        needed = set(_parents(seed)) if isinstance(seed, str) else set()
        text = self._text(seed)
        for node, types_only in _imports(text):
            if not types_only:
                needed |= set(self._resolved(node, seed, text))
        if not self._lazy(seed):  # a package that loads names by text says in its stub what they are
            named = _NAMED.findall(text) if "import_module(" in text or "files(" in text else ()
            needed |= {module for name, end in named for module in self._named(name, end == "{")}
        for name in needed:
            if name not in self._modules:
                raise SourceError(f"There is no module {name}, which {seed} needs: correct the name there.")
        return frozenset(needed)

    def _resolved(self, node: Import, seed: Seed, text: str) -> Iterator[str]:
        """Find the modules that an import statement loads, of those that are followed."""
        if isinstance(node, ast.ImportFrom):
            base = self._base(node, seed)
            if self._follows(base):
                yield base
                for alias in node.names:
                    yield from self._member(base, alias.name)
            return
        for alias in node.names:
            if self._follows(alias.name):
                yield alias.name
                taken = rf"\b{re.escape(alias.asname or alias.name)}\.(\w+)"
                for name in re.findall(taken, text):  # `pt.Controller` of `import pretouch as pt`
                    yield from self._member(alias.name, name)

    def _member(self, package: str, name: str) -> Iterator[str]:
        """Find the module of a package's member, if it has one of its own."""
        lazy = self._lazy(package)
        if f"{package}.{name}" in self._modules:
            yield f"{package}.{name}"
        elif name == "*":
            yield from lazy.values()
        elif name in lazy:
            yield lazy[name]

    def _find_lazy(self, seed: Seed) -> dict[str, str]:
        """Return the module of each name that a package loads when it is asked for: they stand in its stub."""
        found: dict[str, str] = {}
        stub = self._file(seed).with_suffix(".pyi") if self._is_package(seed) else None
        if stub is None or not stub.is_file():
            return found
        for node, _ in _imports(stub.read_text(encoding="utf-8")):
            if isinstance(node, ast.ImportFrom):
                base = self._base(node, seed)
                for alias in node.names:
                    module = f"{base}.{alias.name}"
                    found[alias.asname or alias.name] = module if module in self._modules else base
        return found

    def _base(self, node: ast.ImportFrom, seed: Seed) -> str:
        """Return the full name of what a statement imports from; relative ones of a script are not followed."""
        if not node.level or not isinstance(seed, str):
            return node.module or ""
        parts = seed.split(".")
        base = parts[: len(parts) - node.level + self._is_package(seed)]
        return ".".join([*base, *([node.module] if node.module else [])])

    def _named(self, text: str, beginning: bool) -> Iterator[str]:
        """Find the module of a name, or the package of a folder, or all modules whose names begin so."""
        if not self._follows(text):
            return
        if beginning:
            yield from (name for name in self._modules if name.startswith(text))
        else:
            yield text if text in self._modules else text.rpartition(".")[0]

    def _follows(self, module: str) -> bool:
        return module.partition(".")[0] in self._above

    def _is_package(self, seed: Seed) -> bool:
        return isinstance(seed, str) and seed in self._modules and self._modules[seed].name == "__init__.py"

    def _file(self, seed: Seed) -> Path:
        file = self._modules.get(seed) if isinstance(seed, str) else seed
        if file is None or not file.is_file():
            raise SourceError(f"The source text of {seed} cannot be found: correct its name, or install it with it.")
        return file

    def _text(self, seed: Seed) -> str:
        return self._file(seed).read_text(encoding="utf-8")

    def _find_content(self, seed: Seed) -> tuple[tuple[str, str], ...]:
        file = self._file(seed)
        if not isinstance(seed, str):
            return ((file.name, _digest(file)),)
        above = self._above[seed.partition(".")[0]]
        files = [file, *(self._data.get(seed, ()) if self._is_package(seed) else ())]
        return tuple((path.relative_to(above).as_posix(), _digest(path)) for path in files)


def source_digest(*functions: Callable[..., object]) -> str:
    """Return what tells this state of the source text that functions or classes rest on from any other.

    Of a partial function, that is all it is made of. A function of a script rests on that file and what it imports of
    this package. Raises SourceError where the text cannot be found.
    """
    seeds: list[Seed] = []
    folders = {__name__.partition(".")[0]: Path(__file__).parent}
    for function in _whole(functions):
        root = function.__module__.partition(".")[0]
        if root not in folders:
            package = getattr(sys.modules.get(root), "__path__", None)
            if package is None:
                seeds.append(_script(function))
                continue
            folders[root] = Path(package[0])
        seeds.append(function.__module__)
    return _digest_of(tuple(folders.values()), tuple(seeds))


def _whole(functions: Iterable[object]) -> Iterator[Callable[..., object]]:
    for function in functions:
        if isinstance(function, partial):
            yield from _whole((function.func, *function.args, *function.keywords.values()))
        elif callable(function):
            yield function


def _script(function: Callable[..., object]) -> Path:
    file = getattr(sys.modules.get(function.__module__), "__file__", None)
    if file is None:
        raise SourceError(f"The source text of {function.__qualname__} cannot be found: put it in a file.")
    return Path(file)


@cache
def _digest_of(folders: tuple[Path, ...], seeds: tuple[Seed, ...]) -> str:
    return _sources(folders).digest(*seeds)


@cache
def _sources(folders: tuple[Path, ...]) -> Sources:
    return Sources(*folders)


def _parents(module: str) -> Iterator[str]:
    while "." in module:
        module = module.rpartition(".")[0]
        yield module


def _imports(text: str) -> Iterator[tuple[Import, bool]]:
    """Find all import statements of a text, each with whether it is for a type checker alone."""
    text += "\n"
    last = text.rfind("import")
    if last < 0:
        return
    closing = text.find(")", last) if "(" in text[last:].partition("\n")[0] else last
    try:  # a third of the time: most texts go on long after their last import
        body = ast.parse(text[: text.find("\n", closing) + 1]).body
    except SyntaxError:  # that is within a statement that goes on
        body = ast.parse(text).body
    yield from _imports_of(body, types_only=False)


def _imports_of(body: list[ast.stmt], types_only: bool) -> Iterator[tuple[Import, bool]]:
    for node in body:
        if isinstance(node, Import):
            yield node, types_only
            continue
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            hidden = field == "body" and isinstance(node, ast.If) and _for_types(node.test)
            yield from _imports_of(getattr(node, field, []), types_only or hidden)


def _for_types(test: ast.expr) -> bool:
    return "TYPE_CHECKING" in (getattr(test, "id", ""), getattr(test, "attr", ""))


def _digest(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest()
