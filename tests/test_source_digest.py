"""The digest of a function covers all that it rests on: nothing that it imports can be forgotten."""

import sys
from importlib import import_module
from subprocess import run

import pytest

from pretouch.robot.kinematics import dot
from pretouch.source_digest import source_digest

TREE = {
    "__init__": "Lazy = 1",
    "bottom": "NEAREST = 0.04",
    "arm.__init__": "from .joints import seven",
    "arm.joints": "from ..bottom import NEAREST\nseven = 7",
    "alone": "x = 1",
}
USERS = {
    "from house.bottom import NEAREST": True,
    "from house import bottom as b": True,
    "import numpy, house.bottom": True,
    "from .bottom import (\n    NEAREST,  # (the nearest)\n)": True,
    "from house import (\n    alone,  # :)\n    bottom,\n)": True,
    "from house import alone, \\\n    bottom": True,
    "x = 1; import house.bottom": True,
    "def f():\n    try:\n        pass\n    except OSError:\n        import house.bottom\n": True,
    "def f(x):\n    match x:\n        case 1:\n            from . import bottom\n    return x": True,
    "from house.arm import seven": True,
    "import house.arm.joints as j": True,
    "from house import alone": False,
    "import numpy": False,
    "from house import Lazy": True,
    "import house as h": True,
}


@pytest.fixture
def digest(tmp_path, monkeypatch):
    """Return the digest of a function in a package `house`, some of whose modules have another text."""

    def made(number: int, **texts: str) -> str:
        folder = tmp_path / str(number)
        for name, text in (TREE | texts).items():
            place = folder.joinpath("house", *name.split(".")).with_suffix(".py")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(text)
        for name in [name for name in sys.modules if name.partition(".")[0] == "house"]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.syspath_prepend(folder)
        return source_digest(import_module("house.user").own)

    return made


@pytest.mark.parametrize("text", USERS)
def test_whatever_way_a_module_is_imported_its_text_counts(digest, text):
    user = f"{text}\ndef own(): pass\n"
    before = digest(0, user=user)
    assert digest(1, user=user) == before
    assert (digest(2, user=user, bottom="NEAREST = 0.08") != before) == USERS[text]
    assert digest(3, user=f"{user}\n") != before


SCRIPT = """
from pretouch.source_digest import source_digest
from pretouch.robot.kinematics import dot
def own(): return dot
print(source_digest(own) != source_digest(dot))
"""


def test_a_function_of_a_script_rests_on_its_file(tmp_path):
    assert source_digest(dot) == source_digest(dot)
    (tmp_path / "script.py").write_text(SCRIPT)
    done = run([sys.executable, tmp_path / "script.py"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
    done = run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert "The source text of own cannot be found: put it in a file." in done.stderr
