"""Wheel and source distribution as somebody gets them: in an environment that holds nothing else."""

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest
from tools.wheel import build

ROOT = Path(__file__).parents[1]
CLEAN = {name: text for name, text in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
VERSION = "0.2.0"


def ran(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, cwd=folder, env=CLEAN, capture_output=True, text=True, check=False)


def succeeds(*words: str, folder: Path) -> None:
    done = ran(*words, folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    succeeds(sys.executable, "-m", "venv", "builder", folder=folder)
    python = str(folder / "builder/bin/python")
    succeeds(python, "-m", "pip", "install", "-q", "build", "twine", folder=folder)
    for project in (ROOT, ROOT / "fci", ROOT / "lab"):
        succeeds(python, "-m", "build", "-q", "-o", str(folder / "dist"), str(project), folder=folder)
    return folder


@pytest.mark.slow
def test_what_an_index_is_given_is_whole_and_holds_no_more(built: Path):
    files = sorted(map(str, (built / "dist").iterdir()))
    assert len(files) == 6
    succeeds(str(built / "builder/bin/python"), "-m", "twine", "check", "--strict", *files, folder=built)
    with zipfile.ZipFile(built / f"dist/pretouch-{VERSION}-py3-none-any.whl") as wheel:
        text = message_from_bytes(wheel.read(f"pretouch-{VERSION}.dist-info/METADATA")).get_payload()
    assert "](docs/" not in text
    assert "](https://github.com/pretouch/pretouch/blob/main/docs/" in text
    with tarfile.open(built / f"dist/pretouch-{VERSION}.tar.gz") as source:
        tops = {Path(name).parts[1] for name in source.getnames()}
    expected = {"src", "examples", "CHANGELOG.md", "CITATION.cff", "LICENSE", "NOTICE", "README.md", "PKG-INFO"}
    assert tops == expected | {"pyproject.toml", ".gitignore"}
    assert f"version: {VERSION}\n" in (ROOT / "CITATION.cff").read_text()
    for beside in ("fci", "lab"):
        assert tomllib.loads((ROOT / beside / "pyproject.toml").read_text())["project"]["version"] == VERSION
    with zipfile.ZipFile(built / f"dist/pretouch_fci-{VERSION}-py3-none-any.whl") as wheel:
        assert "pretouch_fci/model_library.c" in wheel.namelist()


@pytest.mark.slow
def test_each_hint_works_in_an_installation_from_a_wheel(built: Path):
    """Follow what each command says is missing, in the words it says it in, until nothing is."""
    succeeds(sys.executable, "-m", "venv", "user", folder=built)
    wheel = f"dist/pretouch-{VERSION}-py3-none-any.whl"
    succeeds(str(built / "user/bin/python"), "-m", "pip", "install", "-q", wheel, folder=built)
    (built / "cut.mcap").touch()
    asked = {
        "replay cut.mcap": "cut.mcap",
        "report gone.mcap": "gone.mcap cannot be read",
        "run franka --ip 127.0.0.1 --no-skin --profile blind --seconds 1": "127.0.0.1",
        "figure nothing": "nothing",
        "serve-fci --seed -1": "ServeFci.seed is -1",
    }
    for words, otherwise in asked.items():
        command = (str(built / "user/bin/pretouch"), *words.split())
        done = ran(*command, folder=built)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        said, _, hint = done.stderr.partition(": run ")
        assert hint, said
        installed = subprocess.run(hint, shell=True, cwd=built, env=CLEAN, capture_output=True, text=True)  # noqa: S602
        assert installed.returncode == 0, installed.stderr
        done = ran(*command, folder=built)
        assert "Traceback" not in done.stderr
        assert ": run " not in done.stderr
        assert otherwise in done.stderr


@pytest.mark.slow
def test_a_wheel_with_machine_code_compiles_nothing(tmp_path: Path):
    wheel = build(tmp_path / "wheel")
    succeeds(sys.executable, "-m", "venv", "user", folder=tmp_path)
    python = str(tmp_path / "user/bin/python")
    succeeds(python, "-m", "pip", "install", "-q", "-c", str(ROOT / "constraints.txt"), str(wheel), folder=tmp_path)
    done = ran("env", "NUMBA_DEBUG_CACHE=1", python, str(ROOT / "examples/00_one_step.py"), folder=tmp_path)
    assert "data loaded" in done.stdout
    assert "data saved" not in done.stdout


@pytest.mark.slow
def test_pytest_finds_the_fixture_of_a_wheel_and_warns_of_nothing(built: Path):
    succeeds(sys.executable, "-m", "venv", "tester", folder=built)
    python = str(built / "tester/bin/python")
    succeeds(python, "-m", "pip", "install", "-q", "--find-links", "dist", "pretouch-fci", "pytest", folder=built)
    # begun by a program that has imported the package before
    program = "import sys, pretouch, pytest; sys.exit(pytest.main(['-W', 'error', '--fixtures', 'dist']))"
    done = ran(python, "-c", program, folder=built)
    assert "franka_server" in done.stdout, done.stderr
