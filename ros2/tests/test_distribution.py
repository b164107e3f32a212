"""The distribution: of the product's version, with the arm that the product says it has."""

import tomllib
from pathlib import Path

import pretouch
from pretouch.arms import GROUP, arm_class
from pretouch.extras import ROS2
from pretouch_ros2.arm import Ros2

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]


def test_it_is_of_the_products_version_and_needs_that():
    assert PROJECT["version"] == pretouch.__version__
    assert f"pretouch=={pretouch.__version__}" in PROJECT["dependencies"]


def test_its_arm_is_the_one_the_product_names():
    assert PROJECT["name"] == ROS2.distribution
    assert list(PROJECT["entry-points"][GROUP]) == ["ros2"]
    assert arm_class("ros2") is Ros2
