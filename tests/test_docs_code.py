"""What documents tell to type: Python blocks, and command lines read by the command line itself."""

import ast
import builtins
import importlib
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from rich.console import Console

import pretouch
from pretouch.cli import _read
from pretouch.errors import PluginError
from pretouch.extras import ROS2
from tests.needs import skip_without

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMED = {
    "check", "clock", "controller", "done", "fixtures", "frames", "model", "panda", "path", "profile", "receiver",
    "recorder", "robot", "skin", "skin_port", "units",
}  # fmt: skip
"""What a block may take as given: each is introduced by its sentence."""
FOREIGN = {"franky", "panda_py", "pylibfranka", "rosbags"}
"""Modules that need an extra, or another program."""


def blocks(kind):
    for document in DOCUMENTS:
        for found in re.findall(rf"^```{kind}\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL):
            yield pytest.param(found, id=f"{document.relative_to(ROOT)}:{found.strip().splitlines()[0][:40]}")


@pytest.mark.parametrize("block", list(blocks("python")))
def test_a_python_block_compiles_and_its_names_are_there(block):
    tree = ast.parse(block)
    compile(tree, "block", "exec")
    known = set(dir(builtins)) | NAMED | {"np", "pt", "Path"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] not in FOREIGN:
            if node.module.startswith("pretouch.hardware.ros2.node"):
                skip_without(ROS2)
            module = importlib.import_module(node.module)
            assert [name.name for name in node.names if not hasattr(module, name.name)] == []
        if isinstance(node, ast.Import | ast.ImportFrom):
            known |= {name.asname or name.name.split(".")[0] for name in node.names}
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            known.add(node.id)
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            known.add(node.name)
        if isinstance(node, ast.arg):
            known.add(node.arg)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "pt":
            assert hasattr(pretouch, node.attr), f"pt.{node.attr}"
    read = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert read - known == set()


def typed():
    """Yield each command line of a block of shell, or of an indented block that begins with the command."""
    for document in DOCUMENTS:
        text = document.read_text()
        shell = re.findall(r"^```sh\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        shell += re.findall(r"^    (?:\.venv/bin/)?pretouch .*$", text, re.MULTILINE)
        for line in "\n".join(shell).replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words:
                yield pytest.param(words, id=f"{document.relative_to(ROOT)}:{' '.join(words)[:60]}")


OTHER_PROGRAMS = {"cd", "done", "esptool", "for", "git", "mkdir", "mpremote", "mpy-cross", "rm", "source"}


@pytest.mark.parametrize("words", list(typed()))
def test_a_command_line_is_one_that_its_program_takes(words):
    for command in _single(words):
        program, *rest = command
        program = program.removeprefix(".venv/bin/")
        if program == "pretouch":
            assert _read(rest, Console(stderr=True)).run
        elif program == "make":
            targets = re.search(r"^\.PHONY: (.*(?:\\\n.*)*)", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
            assert {word for word in rest if "=" not in word} <= set(targets)
        elif program in ("pip", "pipx", "uvx"):
            extras = [extra for word in rest for extra in re.findall(r"\[([\w,]+)\]", word)]
            known = {
                name
                for file in ("pyproject.toml", "lab/pyproject.toml")
                for name in tomllib.loads((ROOT / file).read_text())["project"].get("optional-dependencies", {})
            }
            assert {name for extra in extras for name in extra.split(",")} <= known
        else:
            assert program in OTHER_PROGRAMS


def _single(words):
    """Split what stands between && or ;."""
    command = []
    for word in [*words, "&&"]:
        if word in ("&&", ";", "|", "&"):
            if command:
                yield command
            command = []
        else:
            command.append(word)


def mentioned():
    """Yield each command that a sentence names with its options, as `pretouch skin calibrate --out`."""
    for document in DOCUMENTS:
        for span in re.findall(r"`(pretouch [^`]+)`", document.read_text()):
            yield pytest.param(" ".join(span.split()), id=f"{document.relative_to(ROOT)}:{span[:60]}")


@pytest.mark.parametrize("span", list(mentioned()))
def test_a_command_that_a_sentence_names_exists_with_its_options(span, capsys):
    words = shlex.split(span.split("|")[0])[1:]
    path = [word for word in words if re.fullmatch(r"[a-z][a-z-]*", word)]
    options = {word.split("=")[0] for word in words if word.startswith("--")}
    for length in range(len(path), 0, -1):  # what follows a command may be a value, as an experiment's name
        try:
            with pytest.raises(SystemExit) as ended:
                _read([*path[:length], "--help"], Console(stderr=True))
        except PluginError:
            continue
        if ended.value.code == 0:
            break
    text = capsys.readouterr().out
    assert "usage: pretouch" in text
    assert {option for option in options if not re.search(rf"{option}\b", text)} == set()
