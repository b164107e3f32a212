"""Runs all cases of a module (harness.py) in one process, which is much faster than one each."""

from pathlib import Path

import pytest

from tests.firmware.harness import HERE, Run, cases

_SCRIPT = """
import sys
import cases_{module} as module
for name in {names!r}:
    try:
        getattr(module, name)()
    except Exception as error:
        print("FAILED", name)
        if sys.implementation.name == "micropython":
            sys.print_exception(error)
        else:
            __import__("traceback").print_exc(file=sys.stdout)
print("DONE")
"""


def run_all(run: Run, module: str, files: dict[str, str | bytes | Path] | None = None) -> None:
    """Call every function of a module of `tests/firmware/cases/`; fail the test with all that failed of them."""
    named = {f"cases_{module}.py": HERE / "cases" / f"{module}.py"} | (files or {})
    lines = run(named, _SCRIPT.format(module=module, names=cases(module)))
    if lines != ["DONE"]:
        pytest.fail("\n".join(lines), pytrace=False)
