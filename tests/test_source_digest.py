"""The digest of a function covers all that it rests on: nothing that it imports can be forgotten."""

import sys
from functools import partial
from pathlib import Path
from subprocess import run

import pytest

import pretouch
from pretouch.errors import SourceError
from pretouch.robot.vectors import dot
from pretouch.source_digest import Sources, source_digest

TREE = {
    "__init__.py": """
from importlib import import_module

def __getattr__(name):
    return import_module(f"house.{name}")
""",
    "__init__.pyi": "from house.arm import Arm as Arm\nfrom house import loop as loop\n",
    "bottom.py": "NEAREST = 0.04",
    "loop.py": "",
    "arm/__init__.py": "from .joints import seven\nArm = seven",
    "arm/joints.py": "from ..bottom import NEAREST\nseven = 7",
    "arm/model.xml": "<arm/>",
    "arm/data/skin.toml": "units = 7",
    "alone.py": "x = 1",
    "drivers/__init__.py": "",
    "drivers/fr3.py": "",
    "drivers/panda.py": "",
    "other/__init__.py": "",
    "other/notes.toml": "",
}
USERS = {
    "from house.bottom import NEAREST": {"bottom"},
    "from house import bottom as b": {"bottom"},
    "import house.bottom": {"bottom"},
    "from .bottom import (\n    NEAREST,  # (the nearest)\n)": {"bottom"},
    "from .bottom import \\\n    NEAREST": {"bottom"},
    "x = 1; import house.bottom": {"bottom"},
    "def f():\n    try:\n        pass\n    except OSError:\n        import house.bottom\n": {"bottom"},
    "def f(x):\n    match x:\n        case 1:\n            from . import bottom\n    return x": {"bottom"},
    "if not TYPE_CHECKING:\n    import house.bottom": {"bottom"},
    "if TYPE_CHECKING:\n    import house.alone\nelse:\n    import house.bottom": {"bottom"},
    "import typing\nif typing.TYPE_CHECKING:\n    from house.alone import x": set(),
    "from house.arm import seven": {"arm", "arm.joints", "bottom"},
    "from house import Arm": {"arm", "arm.joints", "bottom"},
    "import house as h\nh.Arm(h.loop)": {"arm", "arm.joints", "bottom", "loop"},
    "import house\nhouse.loop.run()": {"loop"},
    "from house import *": {"arm", "arm.joints", "bottom", "loop"},
    "import_module(f'house.drivers.{name}')": {"drivers", "drivers.fr3", "drivers.panda"},
    "import_module('house.drivers.fr3')": {"drivers", "drivers.fr3"},
    "files('house.arm.data')": {"arm", "arm.joints", "bottom"},
    '"""import house.alone"""\nimport numpy, houses': set(),
}


@pytest.fixture
def house(tmp_path: Path) -> Path:
    folder = tmp_path / "house"
    for place, text in TREE.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(text)
    return folder


@pytest.mark.parametrize("text", USERS)
def test_whatever_way_a_module_is_imported_it_is_found(house, text):
    (house / "user.py").write_text(text)
    assert Sources(house).closure("house.user") == {"house", "house.user", *(f"house.{name}" for name in USERS[text])}


def test_a_change_at_the_bottom_changes_the_digests_of_all_that_depend_on_it_and_of_nothing_else(house):
    names = [f"house.{name}" for name in ("bottom", "arm.joints", "arm", "alone", "loop", "drivers.fr3")]
    before = [Sources(house).digest(name) for name in names]
    assert [Sources(house).digest(name) for name in names] == before
    (house / "bottom.py").write_text("NEAREST = 0.08")
    after = [Sources(house).digest(name) for name in names]
    assert [a != b for a, b in zip(before, after, strict=True)] == [True, True, True, False, False, False]


@pytest.mark.parametrize("place", ["arm/model.xml", "arm/data/skin.toml", "arm/data/new.bin"])
def test_the_files_of_a_package_count_whatever_they_are(house, place):
    arm, alone = (Sources(house).digest(name) for name in ("house.arm.joints", "house.alone"))
    (house / place).write_text("another")
    (house / "other/notes.toml").write_text("another")
    assert Sources(house).digest("house.arm.joints") != arm
    assert Sources(house).digest("house.alone") == alone


def test_what_a_program_leaves_behind_does_not_count(house):
    before = Sources(house).digest("house.arm")
    for place in ("arm/__pycache__/joints.nbi", "arm/.joints.py.swp"):
        (house / place).parent.mkdir(exist_ok=True)
        (house / place).write_text("")
    assert Sources(house).digest("house.arm") == before


def test_a_file_that_moves_is_another(house):
    before = Sources(house).digest("house.arm")
    (house / "arm/model.xml").rename(house / "arm/data/model.xml")
    assert Sources(house).digest("house.arm") != before


def test_a_module_that_was_renamed_is_an_error(house):
    (house / "bottom.py").rename(house / "ground.py")
    with pytest.raises(SourceError, match=r"no module house\.bottom, which house\.arm\.joints needs"):
        Sources(house).digest("house.arm")
    with pytest.raises(SourceError, match=r"source text of house\.bottom cannot be found"):
        Sources(house).digest("house.bottom")


def test_a_function_of_a_script_rests_on_its_file_and_on_ours(house, tmp_path):
    (tmp_path / "script.py").write_text("from house.bottom import NEAREST")
    script = tmp_path / "script.py"
    assert Sources(house).closure(script) == {script, "house", "house.bottom"}
    before = Sources(house).digest(script)
    (house / "bottom.py").write_text("NEAREST = 0.08")
    after = Sources(house).digest(script)
    script.write_text("import house.bottom")
    assert len({before, after, Sources(house).digest(script)}) == 3


def test_a_module_of_ours_does_not_rest_on_what_the_package_loads_by_name():
    assert Sources(Path(pretouch.__file__).parent).closure("pretouch.errors") == {"pretouch", "pretouch.errors"}


SCRIPT = """
from pretouch.source_digest import source_digest
from pretouch.robot.vectors import dot
def own(): return dot
print(source_digest(own) != source_digest(dot))
"""


def test_functions_are_found_wherever_they_are(tmp_path):
    assert source_digest(dot) == source_digest(partial(dot))
    assert source_digest(partial(dot, house)) == source_digest(dot, house) != source_digest(dot)
    (tmp_path / "script.py").write_text(SCRIPT)
    done = run([sys.executable, tmp_path / "script.py"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
    done = run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert "The source text of own cannot be found: put it in a file." in done.stderr
