"""Compiled functions are kept under a name that tells all of them, and work where nothing can be kept."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from platform import machine

import numpy as np
import pytest

import pretouch
from pretouch import compiled

PACKAGE = Path(pretouch.__file__).parent


def test_a_function_without_text_works_all_the_same():
    names: dict[str, object] = {"__name__": "nowhere", "compiled": compiled.compiled}
    exec("@compiled\ndef double(x):\n    return 2.0 * x", names)  # noqa: S102
    assert names["double"](1.5) == 3.0


def full(*_given: object) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize(
    ("place", "how"), [("CompileResultCacheImpl._locator_classes", []), ("IndexDataCacheFile.save", full)]
)
def test_where_nothing_can_be_kept_and_on_a_full_disk_functions_work_all_the_same(monkeypatch, place, how):
    monkeypatch.setattr(f"numba.core.caching.{place}", how)

    def half(x: float) -> float:
        return x / 2

    assert compiled.compiled(half)(3.0) == 1.5


def test_a_division_by_zero_is_a_number():
    @compiled.compiled
    def over(a: float, b: float) -> float:
        return a / b

    assert over(1.0, 0.0) == np.inf
    assert np.isnan(over(0.0, 0.0))


def in_python(code: str, **environment: str) -> str:
    """Run some code in a process of its own; return what it prints."""
    known = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "XDG", "PYTHON"))}
    done = subprocess.run(
        [sys.executable, "-c", code], env=known | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


HELP = "import contextlib, pretouch.cli as cli\nwith contextlib.suppress(SystemExit): cli.main(['--help'])"


@pytest.mark.parametrize(("code", "loads"), [("import pretouch", set()), (HELP, {"tyro", "rich"})])
def test_neither_import_nor_help_loads_heavy_packages(code: str, loads: set[str]):
    loaded = in_python(f"{code}\nimport sys; print(*(n for n in sys.modules if '.' not in n))").split()
    assert {"numpy", "numba", "scipy", "mujoco", "matplotlib", "tyro", "rich"} & set(loaded) == loads


def test_public_names_are_there():
    for name in dir(pretouch):
        assert getattr(pretouch, name) is not None
    assert pretouch.Controller.__module__ == "pretouch.controller"
    with pytest.raises(AttributeError, match="has no attribute 'controler'"):
        _ = pretouch.controler


STEP = """
import numpy as np, pretouch as pt
from pretouch.cli.warm_up import kept_in
arm = pt.RobotModel(pt.panda())
control = pt.Controller(arm, pt.paper_skin(arm), pt.no_fixtures(), pt.Circle(), pt.profile("paper"))
q, rest = arm.description.q_ready, np.zeros(7)
robot = pt.RobotState(0.0, q, rest, q, rest, rest, np.zeros(6))
seen = pt.RangeReadings(np.zeros(7), np.full(7, 0.4), np.zeros(7, np.int64))
step, _ = control.step(control.init(robot), pt.Inputs(0.0, robot, seen))
print(pt.__file__, repr(kept_in()), step.mode.value)
"""


@pytest.mark.slow
def test_an_installation_nobody_can_write_to_works(tmp_path: Path):
    # a file where a folder for the cache would have to be keeps even root from writing there
    package = tmp_path / "pretouch"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [package, *(path for path in package.rglob("*") if path.is_dir())]:
        (folder / "__pycache__").touch()
    home = tmp_path / "home"
    home.touch()
    nowhere = {"HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")}
    said = in_python(STEP, PYTHONPATH=str(tmp_path), PYTHONDONTWRITEBYTECODE="1", **nowhere)
    assert said.split() == [str(package / "__init__.py"), "''", "hold"]
    # and with a home it is kept there
    home.unlink()
    said = in_python(STEP, PYTHONPATH=str(tmp_path), PYTHONDONTWRITEBYTECODE="1", **nowhere)
    assert str(home) in said


MODULE = """
from pretouch.callee import multiplied
from pretouch.compiled import {kind}

@{kind}
def body(x: float, y: float) -> float:
    return multiplied(x) + y
"""
CALLEE = "from pretouch.compiled import {kind}\n\n@{kind}\ndef multiplied(x: float) -> float:\n    return 2.0 * x\n"
CALL = "from pretouch.module import body\nprint(body(1.0, 1.0), sum(body.stats.cache_hits.values()))"


WHEEL = {"NUMBA_CPU_NAME": compiled.LEVEL, "NUMBA_CPU_FEATURES": ""} if machine() == "x86_64" else {}


@pytest.mark.parametrize(("kind", "called", "first"), [("compiled", "compiled", {}), ("entry", "kernel", WHEEL)])
def test_a_function_is_kept_between_processes_until_what_it_calls_changes(tmp_path: Path, kind, called, first):
    package = tmp_path / "pretouch"
    package.mkdir()
    (package / "__init__.py").touch()
    for needed in ("compiled.py", "errors.py", "source_digest.py"):
        shutil.copy(PACKAGE / needed, package)
    (package / "module.py").write_text(MODULE.format(kind=kind))
    (package / "callee.py").write_text(callee := CALLEE.format(kind=called))
    assert in_python(CALL, PYTHONPATH=str(tmp_path), **first).split() == ["3.0", "0"]
    assert in_python(CALL, PYTHONPATH=str(tmp_path)).split() == ["3.0", "1"]
    # of another length: Python takes a file of the same length and second for the one that it has bytecode of
    (package / "callee.py").write_text(callee.replace("2.0", "10.0"))
    assert in_python(CALL, PYTHONPATH=str(tmp_path)).split() == ["11.0", "0"]
