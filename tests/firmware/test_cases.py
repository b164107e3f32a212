"""Each module of tests/firmware/cases, in both interpreters."""

import ast
from pathlib import Path

import pytest

from tests.firmware.harness import HERE, Run

_SCRIPT = """
import sys
import cases_{module} as module
for name in {names!r}:
    try:
        getattr(module, name)()
    except Exception as error:
        print("FAILED", name)
        sys.print_exception(error)
print("DONE")
"""


@pytest.mark.parametrize("path", sorted((HERE / "cases").glob("*.py")), ids=lambda path: path.stem)
def test_on_a_unit(path: Path, unit_python: Run) -> None:
    """Call its functions in one process, but those that begin with _: helpers."""
    tree = ast.parse(path.read_text())
    names = [item.name for item in tree.body if isinstance(item, ast.FunctionDef) and not item.name.startswith("_")]
    lines = unit_python({f"cases_{path.stem}.py": path}, _SCRIPT.format(module=path.stem, names=names))
    if lines != ["DONE"]:
        pytest.fail("\n".join(lines), pytrace=False)
