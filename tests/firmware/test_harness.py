"""The two interpreters give what a script prints, and fail the test if it raises."""

import pytest

from tests.firmware.harness import Run


def test_what_a_script_prints_comes_back_line_by_line(unit_python: Run) -> None:
    assert unit_python({}, "print(1)\nprint()\nprint('ü', end='')") == ["1", "", "ü"]
    assert unit_python({}, "pass") == []


def test_a_file_given_hides_that_of_the_firmware(unit_python: Run) -> None:
    assert unit_python({"vl53l1x.py": "name = 'mine'"}, "import vl53l1x, lsm6ds3\nprint(vl53l1x.name)") == ["mine"]


def test_an_exception_fails_the_test_and_says_where(unit_python: Run) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"(?s)line 2, in f.*ValueError: 7"):
        unit_python({"broken.py": "def f():\n    raise ValueError(7)"}, "print('before')\nimport broken\nbroken.f()")


def test_micropython_is_the_real_one(micropython: Run) -> None:
    lines = micropython({}, "import sys\nprint(sys.implementation.name)\nprint(sys.implementation.version[:2])")
    assert lines == ["micropython", "(1, 27)"]
