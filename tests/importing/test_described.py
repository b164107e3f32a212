"""Robots by the names of the package robot_descriptions, of which a small stand-in is put on the path."""

import sys
from pathlib import Path

import pytest
from tests.importing.made import six_axis, written

from pretouch.cli import main
from pretouch.errors import RobotModelError
from pretouch.importing.read import described
from pretouch.robot.description import robot_named


@pytest.fixture
def package(tmp_path, monkeypatch):
    """An empty package robot_descriptions that knows of one name."""
    folder = tmp_path / "site" / "robot_descriptions"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text('DESCRIPTIONS = {"sixer_description": None}\n')
    monkeypatch.syspath_prepend(str(folder.parent))
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "robot_descriptions"]:
        del sys.modules[name]


def named(package: Path, text: str, name: str = "sixer_description") -> str:
    (package / f"{name}.py").write_text(text)
    return name


def test_the_urdf_or_else_the_mjcf_is_taken_and_the_packages_folder(package):
    both = 'URDF_PATH, MJCF_PATH = "/there/sixer/urdf/a.urdf", "/there/a.xml"\nPACKAGE_PATH = "/there/sixer"\n'
    assert described(named(package, both)) == (Path("/there/sixer/urdf/a.urdf"), Path("/there"))
    only = named(package, 'MJCF_PATH = "/there/mine/a.xml"\n', "mine_mj_description")
    assert described(only) == (Path("/there/mine/a.xml"), Path("/there"))


@pytest.mark.slow
def test_an_arm_is_imported_by_its_name(package, tmp_path, capsys):
    file = written(tmp_path, six_axis())
    name = named(package, f"URDF_PATH = {str(file)!r}\nPACKAGE_PATH = {str(tmp_path)!r}\n")
    out = tmp_path / "sixer"
    told = ["robot", "import", name, "--out", str(out), "--capsules", "1", "--ready", "0,0.3,1.2,0,1.6,0"]
    assert main(told) == 0
    assert "sixer: 6 joints" in capsys.readouterr().out
    assert robot_named(str(out)).ee_body == "tool0"


def test_what_the_package_cannot_bring_is_said_and_how_to_get_it(package):
    with pytest.raises(RobotModelError, match="could not bring it: git: no route to host"):
        described(named(package, "raise OSError('git: no route to host')"))
    with pytest.raises(RobotModelError, match=r"There is no file ur5_description, .* pip install robot_descriptions"):
        described("ur5_description")


def test_an_arm_of_such_a_name_has_to_be_imported_first(tmp_path, monkeypatch):
    with pytest.raises(RobotModelError, match=r"no arm 'ur5e_mj_description': .*`pretouch robot import FILE"):
        robot_named("ur5e_mj_description")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_description").mkdir()
    assert described("my_description") is None
