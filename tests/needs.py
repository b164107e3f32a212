"""Tests that need more than `make setup` installs: each is skipped with the command to run."""

import ast
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pretouch.extras import Extra

NEEDS = "needs: "
"""What the reason of such a skip begins with; the command follows."""
_MARKS = ("slow", "alone")


def skip_for(command: str) -> None:
    """Skip the test that runs; `command` is what would have it run."""
    pytest.skip(NEEDS + command)


def skip_without(extra: Extra) -> None:
    """Skip the test that runs where an extra is not installed."""
    if extra.missing():
        skip_for(f"make {extra.target}")


def modules_with(extra: Extra) -> Callable[[Path, pytest.Collector], pytest.Collector | None]:
    """Return the hook `pytest_pycollect_makemodule` for a folder whose modules cannot be imported without an extra."""

    def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
        if not extra.missing():
            return None
        return Unimported.from_parent(parent, path=module_path, command=f"make {extra.target}")

    return pytest_pycollect_makemodule


class Unimported(pytest.File):
    """A module of tests that is read and not imported: each of its test functions is skipped."""

    def __init__(self, *, command: str, **given: object) -> None:
        super().__init__(**given)
        self.command = command

    def collect(self) -> Iterator["Skipped"]:
        body = ast.parse(self.path.read_text()).body
        whole = [
            ast.unparse(node) for node in body if isinstance(node, ast.Assign) and "pytestmark" in ast.unparse(node)
        ]
        for node in body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                marked = " ".join(whole + [ast.unparse(decorator) for decorator in node.decorator_list])
                yield Skipped.from_parent(self, name=node.name, marked=marked)


class Skipped(pytest.Item):
    """A test function that is skipped, with those of its marks that choose what is run."""

    def __init__(self, *, marked: str, **given: object) -> None:
        super().__init__(**given)
        for name in _MARKS:
            if f"mark.{name}" in marked:
                self.add_marker(name)

    def runtest(self) -> None:
        skip_for(self.parent.command)
