"""The distribution: of the product's version, with the commands that the product says it has."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pretouch
from pretouch import plugins
from pretouch.cli.app import GROUP, command_class, commands_of
from pretouch.extras import FCI

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
_ALONE = """
import sys
absent = "pretouch_lab", "matplotlib", "rosbags", "viser", "panda_py", "pylibfranka", "ruckig"
sys.modules.update(dict.fromkeys(absent))  # to import one of them is an ImportError
from pretouch.cli import main
sys.exit(main(sys.argv[1:]))
"""


def test_it_is_of_the_products_version_and_needs_that():
    assert PROJECT["version"] == pretouch.__version__
    assert PROJECT["dependencies"] == [f"pretouch=={pretouch.__version__}"]


def test_its_commands_are_those_the_product_names():
    assert tuple(PROJECT["entry-points"][GROUP]) == commands_of(FCI)
    assert set(commands_of(FCI)) <= set(plugins.names(GROUP))
    assert all(command_class(name) for name in commands_of(FCI))


def test_it_serves_without_the_lab_and_without_any_extra(tmp_path):
    command = [sys.executable, "-u", "-c", _ALONE, "serve-fci", "--port", "0", "--scene", "static"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as server:
        assert re.match(r"Listening at 127\.0\.0\.1:", server.stdout.readline())
        server.terminate()
