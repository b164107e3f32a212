import re
import runpy
from pathlib import Path

import pytest

from pretouch.sensing.skin import load_skin

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
ELSEWHERE = "07_first_controller", "09_libfranka_program"
"""The tutorial's runs below; the other against an arm: `tests/hardware/franka/test_shielded_program.py`."""


@pytest.mark.parametrize("example", [e for e in EXAMPLES if e.stem not in ELSEWHERE], ids=lambda path: path.stem)
def test_an_example_runs_and_says_something(example, capsys):
    runpy.run_path(str(example), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) >= 2


def test_the_first_program_is_the_tutorials_and_does_what_the_tutorial_says(capsys):
    first = EXAMPLES[0].with_name("07_first_controller.py")
    page = (first.parents[1] / "docs" / "tutorial" / "first-controller.md").read_text()
    assert f"```python\n{first.read_text()}```\n" in page
    runpy.run_path(str(first), run_name="__main__")
    told = [line.split() for line in capsys.readouterr().out.splitlines()]
    speed = {float(words[0]): float(words[3]) for words in told if words[2] == "track"}
    assert max(speed.values()) > 0.25
    assert speed[max(speed)] < 0.1  # slow before the touch
    assert [words[2] for words in told if words[2] != "hold"][-1] == "react"


def test_the_skin_with_zones_is_one(panda_model):
    skin = load_skin(EXAMPLES[0].with_name("panda_zones.toml"), panda_model)
    assert (len(skin.mounted), len(skin)) == (15, 240)


def test_the_readmes_program_runs_as_it_is_written(capsys):
    readme = (EXAMPLES[0].parents[1] / "README.md").read_text()
    (block,) = re.findall(r"^```python\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})  # noqa: S102  # our own text
    assert capsys.readouterr().out.startswith("hold: No usable reading from ")
