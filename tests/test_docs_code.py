"""Python blocks of documents compile, and their names are there."""

import ast
import builtins
import importlib
import re
from pathlib import Path

import pytest

import pretouch
from pretouch.extras import ROS2
from tests.needs import skip_without

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    ROOT / "CONTRIBUTING.md",
    *(ROOT / f"{top}README.md" for top in ("", "fci/")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
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
            if node.module.startswith("pretouch_ros2"):
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
