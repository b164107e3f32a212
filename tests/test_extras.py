"""What each command says and does where an extra is missing: each is hidden in turn, in a process of its own."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from pretouch import extras
from pretouch.cli.app import OWN, split_name
from pretouch.errors import MissingExtraError
from pretouch.extras import FIGURES, FRANKA, LIVE, MESHES, UNITS

EXTRAS = (FIGURES, FRANKA, MESHES, LIVE, UNITS)

URDF = """<robot name="a"><link name="base"><collision><geometry><mesh filename="a.dae"/></geometry></collision></link>
<link name="tip"/><joint name="j" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
ARM = ("run", "franka", "--ip", "127.0.0.1", "--no-skin", "--profile", "blind")
# what is asked for, and the extra it needs; the others end for another reason, beyond all imports
ASKED = [
    (("live", "--profile", "spiral"), LIVE),
    (("replay", "cut.mcap"), LIVE),
    (("replay", "gone.mcap", "--no-page"), None),
    (ARM, FRANKA),
    ((*ARM, "--arm", "fr3"), FRANKA),
    (("run", "--skin", "gone.toml"), None),
    (("robot", "import", "arm.urdf", "--out", "arm"), MESHES),
    (("detect", "gone.csv"), None),
    (("detect", "a.bag"), None),
    (("detect", "force.csv", "--out", "force.png"), FIGURES),
    (("report", "gone.mcap"), FIGURES),
    (("skin", "monitor", "--keys", "gone.toml"), None),
    (("skin", "calibrate", "--skin", "gone.toml", "--recording", "gone.mcap"), None),
    (("skin", "coverage", "gone.toml"), None),
    (("skin", "import", "gone.csv"), None),
    (("skin", "simulate", "--keys", "keys.toml", "--skin", "gone.toml"), None),
    (("skin", "provision", "--id", "a", "--keys", "k.toml", "--ssid", "a", "--host", "::"), None),
    (("skin", "provision", "--id", "a", "--keys", "k.toml", "--ssid", "a", "--host", "10.0.0.1"), UNITS),
    (("skin", "keys", "--keys", "k.toml"), None),
    (("skin", "check-unit", "--id", "a", "--keys", "gone.toml"), None),
    (("warm-up",), None),
]
SCRIPT = """
import io, json, os, sys
from contextlib import redirect_stderr, redirect_stdout
import matplotlib.pyplot, mujoco, numba, rich, scipy, tyro  # once for all: they need none of what is hidden
for hidden, asked in json.loads(sys.argv[1]):
    if os.fork():
        os.wait()
        continue
    loaded = {name: None for name in sys.modules if name.partition(".")[0] in hidden}
    sys.modules.update(loaded | dict.fromkeys(hidden))
    from pretouch.cli import main
    for words in asked:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
            try:
                code = main(words)
            except SystemExit as end:
                code = end.code
        print(json.dumps([hidden, words, code, said.getvalue()]), flush=True)
    os._exit(0)
"""


def test_every_command_is_asked_for():
    assert {split_name(words, ())[0] for words, _ in ASKED} == set(OWN)


@pytest.mark.slow
def test_without_an_extra_a_command_does_without_it_or_says_what_to_run(tmp_path, monkeypatch):
    (tmp_path / "arm.urdf").write_text(URDF)
    for name in ("a.dae", "a.bag", "cut.mcap"):
        (tmp_path / name).write_text("")
    (tmp_path / "force.csv").write_text("time_s,force_x_N,force_y_N,force_z_N\n0,0,0,0\n")
    monkeypatch.chdir(tmp_path)
    asked = [(extra, words, needed) for extra in EXTRAS for words, needed in ASKED if needed in (None, extra)]
    given = [[extra.modules, [words for one, words, _ in asked if one is extra]] for extra in EXTRAS]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps(given)], capture_output=True, text=True, check=False
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(answers) == len(asked), done.stderr
    for (extra, words, needed), (hidden, said_to, code, said) in zip(asked, answers, strict=True):
        assert (tuple(hidden), tuple(said_to)) == (extra.modules, words)
        assert "Traceback" not in said, (extra, words)
        assert code in (0, 2), (extra, words, said)
        if needed:
            assert code == 2, (extra, words)
            assert f"of the extra '{extra.name}': run {extra.command}\n" in said, (words, said)
        else:
            assert "extra" not in said, (extra, words, said)
            assert "usage" not in said, (extra, words, said)


@pytest.fixture
def clone(monkeypatch, tmp_path):
    """A clone whose Python has a name that a shell would take apart."""
    monkeypatch.setattr(extras, "find_spec", lambda name: object() if name == "pip" else None)
    monkeypatch.setattr(extras, "_CLONE", tmp_path)
    monkeypatch.setattr(sys, "executable", "/a b/python")
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "pyproject.toml").touch()
    return tmp_path


def test_the_sentence_names_make_in_a_clone_and_pip_of_the_folder_in_another_environment(clone, monkeypatch):
    with pytest.raises(MissingExtraError) as caught:
        FRANKA.need("A Franka arm", "ruckig")
    assert str(caught.value) == (
        f"A Franka arm needs ruckig of the extra 'franka': run '/a b/python' -m pip install -e '{clone}[franka]'"
    )
    assert extras.install_command(extras.LAB, "sweep") == f"'/a b/python' -m pip install -e '{clone}/lab[sweep]'"
    monkeypatch.setattr(sys, "prefix", str(clone / ".venv"))
    monkeypatch.chdir(clone)
    assert FRANKA.command == "make franka"
    assert LIVE.command == "make setup"
    monkeypatch.chdir("/")
    assert FRANKA.command == f"make -C {clone} franka"


@pytest.mark.parametrize(
    ("there", "origin", "pip", "beside"),
    [
        (["pip"], None, "/v/python -m pip install", ""),
        (["pip"], "https://b/pretouch-0.2.0-py3-none-any.whl", "/v/python -m pip install", ""),
        (["pip"], "file:///a%20b/pretouch-0.2.0-py3-none-any.whl", "/v/python -m pip install", "--find-links '/a b' "),
        (["pretouch_fci"], None, "uv pip install --python /v/python", ""),
    ],
)
def test_a_hint_is_for_what_made_the_environment(monkeypatch, tmp_path, there, origin, pip, beside):
    own = SimpleNamespace(read_text=lambda name: origin and json.dumps({"url": origin}))
    monkeypatch.setattr(extras, "find_spec", lambda name: object() if name in there else None)
    monkeypatch.setattr(extras, "distribution", lambda name: own)
    monkeypatch.setattr(extras, "version", lambda name: "0.2.0")
    monkeypatch.setattr(extras, "_CLONE", tmp_path)
    monkeypatch.setattr(sys, "executable", "/v/python")
    assert LIVE.command == f"{pip} 'pretouch[live]'"
    assert extras.install_command(extras.LAB) == f"{pip} {beside}'pretouch-lab==0.2.0'"
    if "pretouch_fci" in there:
        assert extras.install_command(extras.FCI, "test") == f"{pip} 'pretouch-fci[test]'"


@pytest.mark.parametrize("extra", EXTRAS, ids=lambda extra: extra.name)
def test_an_extra_is_one_that_its_distribution_has_and_make_installs(extra):
    root = Path(__file__).parents[1]
    assert extra.name in tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert f"\n{extra.target}: " in (root / "Makefile").read_text()
