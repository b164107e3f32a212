"""Documents: links, names, tests and the names in Python blocks that they give are there."""

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
ROWS = re.findall(
    r"^\| (?:(\d+) \| )?.*? \| `(pretouch[\w.]+)` \| `(tests/[\w/]+\.py)::(\w+)` \|$",
    (ROOT / "docs" / "reference" / "equations.md").read_text(),
    flags=re.MULTILINE,
)


def resolve(path):
    parts = path.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for name in parts[cut:]:
            found = getattr(found, name)
        return found
    raise AssertionError(f"{path} does not exist")


def test_every_equation_is_in_the_table():
    assert {int(number) for number, *_ in ROWS if number} == set(range(1, 13))
    assert len(ROWS) == 24


@pytest.mark.parametrize(("number", "function", "file", "test"), ROWS)
def test_the_table_of_equations_is_true(number, function, file, test):
    found = resolve(function)
    assert callable(found)
    if number:
        assert re.search(rf"\beqs?\. {number}\b", found.__doc__)
    assert f"def {test}(" in (ROOT / file).read_text()


DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("*/README.md"), *(ROOT / "docs").rglob("*.md")])


def anchors(document):
    """Of each heading: lower case, no punctuation, hyphens for blanks; what GitHub makes of it."""
    text = re.sub(r"^```.*?^```", "", document.read_text(), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_between_documents_lead_somewhere(document):
    for target, anchor in re.findall(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)", document.read_text()):
        found = document.parent / target if target else document
        assert found.exists(), target
        assert not anchor or anchor in anchors(found), f"{target}#{anchor}"


def test_the_index_has_every_document():
    index = (ROOT / "docs" / "index.md").read_text()
    found = [path for kind in ("*.md", "*.ipynb") for path in (ROOT / "docs").rglob(kind)]
    documents = {str(path.relative_to(ROOT / "docs")) for path in found} - {"index.md"}
    assert documents == set(re.findall(r"^- .*?\]\(([^)]*)\)", index, flags=re.MULTILINE))


def test_documents_that_code_and_messages_name_are_there():
    files = [ROOT / "Makefile", ROOT / "pyproject.toml"]
    files += [p for top in ("src", "tests", "fci", "lab", "firmware", "examples") for p in (ROOT / top).rglob("*.*")]
    kinds = {".py", ".toml", ".msg", ""}
    named = {
        (path, name)
        for path in files
        if path.suffix in kinds
        for name in re.findall(r"\bdocs/[\w/-]+\.md", path.read_text())
        if path.parent.name not in ("house", "site")
    }
    assert len(named) > 20
    assert [f"{path}: {name}" for path, name in named if not (ROOT / name).exists()] == []


def test_names_in_the_notation_exist():
    text = (ROOT / "docs" / "reference" / "notation.md").read_text()
    for owner, name in re.findall(r"`(\w+)\.(\w+)(?:\.min\(\))?`", text):
        if owner[0].isupper() and owner != "RobotModel":
            modules = (
                "pretouch.types", "pretouch.params", "pretouch.control.path",
                "pretouch.control.approach", "pretouch.contact.window",
                "pretouch.contact.residual_model", "pretouch.contact.moving_thresholds",
                "pretouch.contact.sequential_test", "pretouch.contact.reaction", "pretouch.sensing.skin",
            )  # fmt: skip
            owners = [vars(importlib.import_module(m)).get(owner) for m in modules]
            assert any(name in o.__annotations__ or hasattr(o, name) for o in owners if o), f"{owner}.{name}"


def test_the_tests_that_hold_the_threats_are_there() -> None:
    named = re.findall(r"`((?:\w+/)*test_\w+)`", (ROOT / "SECURITY.md").read_text())
    assert len(named) > 10
    there = [name for name in named if (ROOT / f"{name}.py").exists() or list((ROOT / "tests").rglob(f"{name}.py"))]
    assert there == named


NAMED = {
    "check", "clock", "controller", "done", "fixtures", "frames", "model", "panda", "path", "profile", "receiver",
    "recorder", "robot", "skin", "skin_port", "units",
}  # fmt: skip
"""What a block may take as given: each is introduced by its sentence."""
FOREIGN = {"franky", "panda_py", "pylibfranka", "rosbags"}
"""Modules that need an extra, or another program."""


def blocks():
    for document in DOCUMENTS:
        for found in re.findall(r"^```python\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL):
            yield pytest.param(found, id=f"{document.relative_to(ROOT)}:{found.strip().splitlines()[0][:40]}")


@pytest.mark.parametrize("block", list(blocks()))
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
