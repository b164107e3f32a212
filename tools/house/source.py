"""What the Python files of a folder are like: size, functions, comments, imports."""

import ast
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp

_Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Function:
    """A function or method: where it is, its lines, and its parameters but self and cls."""

    place: str
    lines: int
    parameters: int


@dataclass(frozen=True)
class Source:
    """The Python files below a folder."""

    folder: Path

    @cached_property
    def files(self) -> dict[Path, int]:
        """Number of lines by file."""
        return {path: len(path.read_bytes().splitlines()) for path in sorted(self.folder.rglob("*.py"))}

    @cached_property
    def functions(self) -> list[Function]:
        """All functions, nested ones too."""
        return [found for path in self.files for found in _functions(path, self.folder)]

    @cached_property
    def _tokens(self) -> list[list[tokenize.TokenInfo]]:
        found = []
        for path in self.files:
            with tokenize.open(path) as file:
                found.append(list(tokenize.generate_tokens(file.readline)))
        return found

    @cached_property
    def _comments(self) -> list[tokenize.TokenInfo]:
        tokens = (token for file in self._tokens for token in file)
        return [token for token in tokens if token.type == tokenize.COMMENT and not _TO_TOOLS.match(token.string)]

    @property
    def lines(self) -> int:
        """Lines but those that hold a comment alone: a reason costs nothing."""
        return sum(self.files.values()) - sum(token.line.lstrip().startswith("#") for token in self._comments)

    @property
    def comment_share(self) -> float:
        """Lines that hold a comment, as a share of those that hold code or a docstring."""
        code = sum(
            len({line for token in tokens if token.type not in _BLANK for line in _lines(token)})
            for tokens in self._tokens
        )
        return len(self._comments) / max(code, 1)


_TO_TOOLS = re.compile(r"#\s*(fmt|noqa|type)\b")
"""Comments that speak to a tool and not to a reader."""
_BLANK = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def _lines(token: tokenize.TokenInfo) -> range:
    return range(token.start[0], token.end[0] + 1)


def _functions(path: Path, folder: Path) -> Iterator[Function]:
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, _Function):
            place = f"{path.relative_to(folder.parent)}:{node.name}"
            yield Function(place, (node.end_lineno or node.lineno) - node.lineno + 1, _parameters(node.args))


def _parameters(arguments: ast.arguments) -> int:
    every = [*arguments.posonlyargs, *arguments.args]
    of_object = bool(every) and every[0].arg in ("self", "cls")
    return len(every) - of_object + len(arguments.kwonlyargs)


def import_cycle(packages: list[str]) -> list[str]:
    """Return modules that import each other in a circle, the first again at the end; none where there is no circle."""
    graph = grimp.build_graph(*packages, exclude_type_checking_imports=True)
    imported = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    try:
        TopologicalSorter(imported).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []
