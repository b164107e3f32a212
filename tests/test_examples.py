import re
import runpy
import tomllib
from pathlib import Path

import pytest
import tomli_w

from pretouch.sensing.sensor import Capacitive
from pretouch.sensing.skin import load_skin

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
ELSEWHERE = "07_first_controller", "09_libfranka_program", "11_train_under_the_shield"
"""The tutorial's runs below; the others in `tests/arms/franka/test_shielded_program.py`, `lab/tests/learning`."""


@pytest.mark.parametrize("example", [e for e in EXAMPLES if e.stem not in ELSEWHERE], ids=lambda path: path.stem)
def test_an_example_runs_and_says_something(example, capsys):
    runpy.run_path(str(example), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) >= 2


def test_the_first_program_is_the_tutorials_and_does_what_the_tutorial_says(capsys):
    first = EXAMPLES[0].with_name("07_first_controller.py")
    page = (first.parents[1] / "docs" / "tutorial" / "first-controller.md").read_text()
    assert f"```python\n{first.read_text()}```\n" in page
    runpy.run_path(str(first), run_name="__main__")
    lines = [line.split(maxsplit=5) for line in capsys.readouterr().out.splitlines()]
    tracked = [(float(speed), sentence) for _, _, mode, speed, _, sentence in lines if mode == "track"]
    assert max(speed for speed, _ in tracked) > 0.25
    slow, sentence = tracked[-1]  # before the touch
    assert slow < 0.1
    assert re.fullmatch(r"(Waiting|Slowed to \d+ %): left sees something at 0\.0\d m\..*", sentence)
    assert [mode for _, _, mode, *_ in lines if mode != "hold"][-1] == "react"


def test_the_map_of_an_electrode_is_a_sensor_type_of_a_skin_file(panda_model, capsys, tmp_path):
    runpy.run_path(str(EXAMPLES[0].with_name("10_map_of_an_electrode.py")), run_name="__main__")
    unit = {"id": "a", "link": "panda_hand", "position_m": [0, 0, 0.2], "quaternion_wxyz": [1, 0, 0, 0]}
    table = {"unit": [unit | {"sensor": "electrode"}], **tomllib.loads(capsys.readouterr().out)}
    (tmp_path / "skin.toml").write_text(tomli_w.dumps(table))
    (unit,) = load_skin(tmp_path / "skin.toml", panda_model).mounted
    assert isinstance(unit.sensor, Capacitive)
    # of two things whose signals are 0.6 and 1.4 of 2e-4 / (d + 0.03 m)^2.5
    assert unit.sensor.distance(2e-4 / 0.13**2.5) == pytest.approx(0.1, rel=0.1)
    assert unit.sensor.spread_1 > 0.2


def test_the_readmes_program_tracks_slows_and_detects_as_it_is_written(capsys):
    readme = (EXAMPLES[0].parents[1] / "README.md").read_text()
    (block,) = re.findall(r"^```python\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)
    names = {}
    exec(compile(block, "README.md", "exec"), names)  # noqa: S102  # our own text
    lines = capsys.readouterr().out.splitlines()
    moving, slowed, touched = (
        [float(line.split()[0]) for line in lines if re.search(pattern, line)]
        for pattern in (r"Moving at 0\.2\d m/s", r"(Slowed to \d+ %|Waiting): .* at 0\.0", "Touched at panda_hand")
    )
    assert moving
    assert slowed
    assert touched
    assert max(moving) < min(slowed) < 3.25 < min(touched)
    assert names["robot"].time == pytest.approx(5.0)
