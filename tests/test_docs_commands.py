"""Command lines of documents, as they are printed: each is one that its program takes, and quick ones are run."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from rich.console import Console

from pretouch.cli import _read
from pretouch.errors import PluginError
from pretouch.extras import ROS2
from tests.needs import skip_without
from tests.ports import free_port

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("[a-z]*/README.md"))]
DOCUMENTS += sorted((ROOT / "docs").rglob("*.md"))
OURS = r"(?:\.venv/bin/)?(?:pretouch|python|make|pip)"
"""Programs whose lines are commands wherever a line of code begins with one."""
OTHER_PROGRAMS = {"cd", "done", "esptool", "for", "git", "mkdir", "mpremote", "mpy-cross", "rm", "ros2", "source"}


def lines_of_code(text: str) -> list[str]:
    """Return the command lines of a document: of shell blocks all, of other blocks and indented ones our programs'."""
    lines: list[str] = []
    fence = ""
    for line in text.replace("\\\n", " ").splitlines():
        if opening := re.match(r" *```(\w*)$", line):
            fence = "" if fence else opening[1] or "none"
        elif fence in ("sh", "bash") or ((fence or line.startswith("    ")) and re.match(rf" *{OURS}(?: |$)", line)):
            lines.append(line.strip())
    return lines


def typed() -> Iterator[object]:
    for document in DOCUMENTS:
        for line in lines_of_code(document.read_text()):
            if words := shlex.split(line, comments=True):
                yield pytest.param(words, id=f"{document.relative_to(ROOT)}:{' '.join(words)[:60]}")


def named_in_sentences() -> Iterator[object]:
    """Yield each command of another program of ours that a sentence names whole."""
    for document in DOCUMENTS:
        for span in re.findall(r"`((?:make|python) [^`\n]+)`", document.read_text()):
            words = re.sub(r"\[.*?\]", "", span).split()  # in brackets stands what may be left out
            yield pytest.param(words, id=f"{document.relative_to(ROOT)}:{span[:60]}")


@pytest.mark.parametrize("words", [*typed(), *named_in_sentences()])
def test_a_command_line_is_one_that_its_program_takes(words: list[str]) -> None:
    for program, *rest in single_commands(words):
        match program.removeprefix(".venv/bin/"):
            case "pretouch":
                check_pretouch(rest)
            case "make":
                dry = subprocess.run(["make", "-n", *rest], cwd=ROOT, capture_output=True, text=True, check=False)  # noqa: S607
                assert dry.returncode == 0, dry.stderr
            case "python":
                check_python(rest)
            case "pip":
                check_pip(rest)
            case "cp":
                assert (ROOT / rest[0]).exists()
            case other:
                assert other in OTHER_PROGRAMS


def check_pretouch(words: Sequence[str]) -> None:
    if words[:2] == ["run", "ros2"]:
        skip_without(ROS2)
    if "--help" in words:
        with pytest.raises(SystemExit, match="0"):
            _read(words, Console(stderr=True))
    else:
        assert _read(words, Console(stderr=True)).run


def single_commands(words: Sequence[str]) -> Iterator[list[str]]:
    """Split what stands between && or ;."""
    command: list[str] = []
    for word in [*words, "&&"]:
        if word in ("&&", ";", "|", "&"):
            if command:
                yield command
            command = []
        else:
            command.append(word)


def check_python(words: Sequence[str]) -> None:
    """Check that a clone has the program, and that the program knows its options."""
    name = words[1].replace(".", "/") if words[0] == "-m" else words[0]
    places = (ROOT / name, ROOT / "lab/src" / name)
    sources = [
        path for place in places for path in (place, place.with_suffix(".py"), *place.glob("*.py")) if path.is_file()
    ]
    assert sources, words
    text = "\n".join(path.read_text() for path in sources)
    assert [word for word in words[1:] if word.startswith("--") and f'"{word}"' not in text] == []


def check_pip(words: Sequence[str]) -> None:
    """Check that what is to be installed is in a clone, as no index has the package, with extras that it has."""
    for requirement in words[1:]:
        place = re.fullmatch(r"(\.(?:/\w+)?)(?:\[([\w,]+)\])?", requirement)
        assert place, requirement
        project = tomllib.loads((ROOT / place[1] / "pyproject.toml").read_text())["project"]
        assert set(filter(None, (place[2] or "").split(","))) <= set(project.get("optional-dependencies", {}))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_document_installs_from_an_index_that_does_not_have_the_package(document: Path) -> None:
    assert re.findall(r"pip install ['\"]?pretouch.*", document.read_text()) == []


def mentioned() -> Iterator[object]:
    """Yield each command that a sentence names with its options, as `pretouch skin calibrate --out`."""
    for document in DOCUMENTS:
        for span in re.findall(r"`(pretouch [^`]+)`", document.read_text()):
            yield pytest.param(" ".join(span.split()), id=f"{document.relative_to(ROOT)}:{span[:60]}")


@pytest.mark.parametrize("span", list(mentioned()))
def test_a_command_that_a_sentence_names_exists_with_its_options(span, capsys):
    words = shlex.split(span.split("|")[0])[1:]
    if words[:2] == ["run", "ros2"]:
        skip_without(ROS2)
    path = [word for word in words if re.fullmatch(r"[a-z][a-z-]*", word)]
    options = {word.split("=")[0] for word in words if word.startswith("--")}
    for length in range(len(path), 0, -1):  # what follows a command may be a value, as an experiment's name
        try:
            with pytest.raises(SystemExit) as ended:
                _read([*path[:length], "--help-all" if path[0] == "run" else "--help"], Console(stderr=True))
        except PluginError:
            continue
        if ended.value.code == 0:
            break
    text = capsys.readouterr().out
    assert "usage: pretouch" in text
    assert {option for option in options if not re.search(rf"{option}\b", text)} == set()


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A folder in which commands are typed as in a clone, with what they write kept apart."""
    for name in ("examples", "src", "tools"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def as_printed(document: str, line: str) -> list[str]:
    """Return the words of a line that a document prints, its programs being those of this environment."""
    text = (ROOT / document).read_text()
    printed = [words for code in lines_of_code(text) if (words := shlex.split(code, comments=True))]
    printed += [span.split() for span in re.findall(r"`([^`\n]+)`", text)]
    words = shlex.split(line)
    assert words in printed, f"{document} no longer prints {line}"
    program = words[0].removeprefix(".venv/bin/")
    here = {"pretouch": [sys.executable, "-m", "pretouch.cli"], "python": [sys.executable]}
    return [*here.get(program, [program]), *words[1:]]


def run(words: Sequence[str], folder: Path) -> str:
    """Run a command in a folder, and return what it prints."""
    environment = {**os.environ, "XDG_STATE_HOME": str(folder / "state")}
    ended = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.slow
def test_the_readmes_recording_is_made_recomputed_and_reported(clone: Path) -> None:
    live = [*as_printed("README.md", "pretouch live --record my-run.mcap"), "--port", str(free_port())]
    with subprocess.Popen(live, cwd=clone, stdout=subprocess.PIPE, text=True) as page:
        assert page.stdout
        assert page.stdout.readline().startswith("The arm is at http://127.0.0.1:")
        deadline = time.monotonic() + 60
        while (clone / "my-run.mcap").stat().st_size < 100_000:
            assert time.monotonic() < deadline, "nothing is being recorded"
            time.sleep(0.05)
        page.send_signal(signal.SIGINT)
    verified = run(as_printed("README.md", "pretouch replay my-run.mcap --verify"), clone)
    assert "are the same bit for bit" in verified
    run(as_printed("README.md", "pretouch report my-run.mcap"), clone)
    assert (clone / "report.html").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "lines", "written"),
    [
        (
            "docs/tutorial/build-a-skin.md",
            [
                "cp src/pretouch/sensing/data/panda_seven_units.toml my_skin.toml",
                "pretouch skin coverage my_skin.toml",
                "pretouch skin coverage my_skin.toml --suggest 4 --out more.toml",
            ],
            ["my_skin.toml", "more.toml"],
        ),
        ("docs/tutorial/first-controller.md", [".venv/bin/python examples/07_first_controller.py"], []),
        ("docs/how-to/calibrate.md", ["pretouch skin calibrate --plan motion.csv"], ["motion.csv"]),
        (
            "docs/how-to/wiring.md",
            ["python -m tools.holder build/holder"],
            ["build/holder/tray.stl", "build/holder/lid.stl"],
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_a_page_tells_to_type_works_in_a_clone(
    document: str, lines: list[str], written: list[str], clone: Path
) -> None:
    for line in lines:
        run(as_printed(document, line), clone)
    assert [name for name in written if not (clone / name).stat().st_size] == []
