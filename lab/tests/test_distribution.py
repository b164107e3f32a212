"""The lab's distribution: of the product's version, with the commands that the product says it has."""

import sys
import tomllib
from pathlib import Path

import pytest

import pretouch
from pretouch import cli, plugins
from pretouch.cli.app import GROUP, command_class, commands_of
from pretouch.extras import LAB
from pretouch_lab.learning import LEARN
from pretouch_lab.sweep import SWEEP

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]


def test_it_is_of_the_products_version_and_its_commands_are_those_the_product_names():
    assert PROJECT["version"] == pretouch.__version__
    assert PROJECT["dependencies"] == [f"pretouch[figures]=={pretouch.__version__}"]
    assert sorted(PROJECT["entry-points"][GROUP]) == sorted(commands_of(LAB))
    assert set(commands_of(LAB)) <= set(plugins.names(GROUP))
    for name in commands_of(LAB):
        assert command_class(name) is not None


@pytest.mark.parametrize("extra", [LEARN, SWEEP], ids=lambda extra: extra.name)
def test_an_extra_is_one_that_the_distribution_has_and_make_installs(extra):
    assert extra.name in PROJECT["optional-dependencies"]
    assert f"\n{extra.target}: " in (Path(__file__).parents[2] / "Makefile").read_text()


def test_a_sweep_without_its_extra_says_what_to_run(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "SALib", None)
    assert cli.main(["sweep", "static", "--vary", "detect.f_base_n=7:20", "--samples", "2"]) == 2
    assert capsys.readouterr().err.endswith(f"of the extra 'sweep': run {SWEEP.command}\n")
