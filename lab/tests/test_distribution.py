"""The lab's distribution: of the product's version, with the commands that the product says it has."""

import tomllib
from pathlib import Path

import pretouch
from pretouch import plugins
from pretouch.cli.registry import GROUP, LAB, command_class

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]


def test_it_is_of_the_products_version_and_needs_that():
    assert PROJECT["version"] == pretouch.__version__
    assert PROJECT["dependencies"] == [f"pretouch[figures]=={pretouch.__version__}"]


def test_its_commands_are_those_the_product_names():
    assert sorted(PROJECT["entry-points"][GROUP]) == sorted(LAB)
    assert set(LAB) <= set(plugins.names(GROUP))
    for name in LAB:
        assert command_class(name) is not None
