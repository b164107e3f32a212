"""Measures of the Python files of a folder: size, functions, names, imports."""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp

PARTICIPLES = frozenset(
    {"found", "said", "told", "made", "kept", "given", "asked", "wanted", "known", "shown", "taken", "held"}
)
"""Names of variables that describe what was done to a value, instead of the value."""


@dataclass(frozen=True)
class Function:
    """A function or method: where it is, its lines, and its parameters but self and cls."""

    place: str
    lines: int
    parameters: int


class Source:
    """Python files, and what is counted in them. Lines are raw: comments, docstrings and blank lines count."""

    def __init__(self, files: Iterable[Path], root: Path) -> None:
        """Take the files; `root` is the folder that places are named from."""
        self._root = root
        self._text = {path.relative_to(root): path.read_text(encoding="utf-8") for path in sorted(files)}

    @cached_property
    def _trees(self) -> dict[Path, ast.Module]:
        return {path: ast.parse(text) for path, text in self._text.items()}

    @cached_property
    def _nodes(self) -> list[ast.AST]:
        return [node for tree in self._trees.values() for node in ast.walk(tree)]

    @property
    def files(self) -> dict[Path, int]:
        """Number of lines by file."""
        return {path: len(text.splitlines()) for path, text in self._text.items()}

    @property
    def lines(self) -> int:
        """Number of lines of all files."""
        return sum(self.files.values())

    @property
    def format_skips(self) -> int:
        """Number of places that the formatter leaves out."""
        return sum(text.count("# fmt: skip") for text in self._text.values())

    @property
    def repeated_classes(self) -> list[str]:
        """Names that several classes have; a leading underscore is no difference."""
        counts = Counter(node.name.lstrip("_") for node in self._nodes if isinstance(node, ast.ClassDef))
        return sorted(name for name, count in counts.items() if count > 1)

    @property
    def participles(self) -> int:
        """Number of assignments to variables named by a participle."""
        stores = (node for node in self._nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store))
        return sum(node.id in PARTICIPLES for node in stores)

    @cached_property
    def functions(self) -> list[Function]:
        """All functions, nested ones too."""
        return [function for path, tree in self._trees.items() for function in _functions(path, tree)]


def _functions(path: Path, tree: ast.Module) -> Iterator[Function]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            yield Function(f"{path}:{node.name}", lines, _parameters(node.args))


def _parameters(arguments: ast.arguments) -> int:
    every = [*arguments.posonlyargs, *arguments.args]
    of_object = bool(every) and every[0].arg in ("self", "cls")
    return len(every) - of_object + len(arguments.kwonlyargs)


def import_cycle(packages: list[str]) -> list[str]:
    """Return modules that import each other in a circle, the first again at the end; none where there is no circle."""
    graph = grimp.build_graph(*packages, exclude_type_checking_imports=True)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []
