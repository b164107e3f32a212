"""The distribution, and the packages for a ROS 2 workspace: launch files start what is there, with known parameters."""

import re
import runpy
import sys
import tomllib
from collections import defaultdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from rich.console import Console
from ruamel.yaml import YAML

from pretouch import __version__, cli
from pretouch.arms import GROUP, arm_class
from pretouch.cli.run.command import Run, check_options
from pretouch.extras import ROS2
from pretouch.profiles import PROFILES
from pretouch.recording.ros import OWN, own_definition
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch_ros2.arm import Ros2
from pretouch_ros2.commander import TOPICS

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
BRINGUP = ROOT / "pretouch_bringup"


def yaml(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path.read_text())


def test_it_is_of_the_products_version_and_needs_that():
    assert PROJECT["version"] == __version__
    assert f"pretouch=={__version__}" in PROJECT["dependencies"]


def test_its_arm_is_the_one_the_product_names():
    assert PROJECT["name"] == ROS2.distribution
    assert list(PROJECT["entry-points"][GROUP]) == ["ros2"]
    assert arm_class("ros2") is Ros2


def test_the_messages_are_those_of_recordings():
    there = {path.stem: path.read_text() for path in (ROOT / "pretouch_msgs" / "msg").glob("*")}
    assert there == {name: own_definition(name) for name in OWN}, "copy src/pretouch/recording/msg/*.msg"


@pytest.mark.parametrize("name", OWN)
def test_rosidl_takes_the_names_of_each_message(name):
    fields = re.findall(r"^[\w\[\]/]+ +(\w+)", own_definition(name), re.MULTILINE)
    assert fields
    assert re.fullmatch(r"[A-Z][A-Za-z0-9]*", name)
    assert all(re.fullmatch(r"[a-z](?:[a-z0-9]|_(?!_))*(?<!_)", field) for field in fields)


@pytest.mark.parametrize("package", ["pretouch_msgs", "pretouch_bringup"])
def test_a_package_names_itself_alike_and_declares_what_it_uses(package):
    root = ElementTree.parse(ROOT / package / "package.xml").getroot()  # noqa: S314
    assert (root.attrib["format"], root.findtext("name"), root.findtext("version")) == ("3", package, __version__)
    cmake = (ROOT / package / "CMakeLists.txt").read_text()
    assert f"project({package})" in cmake
    declared = {element.text for element in root if element.tag.endswith("_depend")}
    assert set(re.findall(r"find_package\((\w+) REQUIRED\)", cmake)) <= declared
    assert cmake.rstrip().endswith("ament_package()")
    used = re.findall(r'package="(\w+)"', "".join(path.read_text() for path in (ROOT / package).glob("launch/*")))
    assert set(used) <= declared


class Launch:
    """Stands in for ROS 2's launch: keeps what is made, and knows the arguments."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **arguments: str) -> None:
        self.made: dict[str, list[dict[str, Any]]] = defaultdict(list)
        self.arguments = arguments
        modules = {
            "launch": ["LaunchDescription"], "launch_ros": [], "launch_ros.actions": ["Node"],
            "launch.actions": ["DeclareLaunchArgument", "ExecuteProcess", "OpaqueFunction"],
        }  # fmt: skip
        given = {module: {name: partial(self._keep, name) for name in names} for module, names in modules.items()} | {
            "launch.substitutions": {"LaunchConfiguration": self._configuration},
            "ament_index_python": {},
            "ament_index_python.packages": {"get_package_share_directory": lambda name: str(ROOT / name)},
            "yaml": {"safe_load": lambda file: yaml(Path(file.name))},
        }
        for module, members in given.items():
            monkeypatch.setitem(sys.modules, module, SimpleNamespace(**members))

    def _keep(self, kind: str, *parts: Any, **named: Any) -> str:
        self.made[kind].append(named | {"parts": parts})
        return kind

    def _configuration(self, name: str) -> Any:
        return SimpleNamespace(perform=lambda _: self.arguments.get(name) or self.default(name))

    def default(self, name: str) -> str:
        return next(one["default_value"] for one in self.made["DeclareLaunchArgument"] if one["parts"] == (name,))

    def run(self, path: Path) -> dict[str, Any]:
        space = runpy.run_path(str(path))
        assert space["generate_launch_description"]() == "LaunchDescription"
        return space


@pytest.mark.parametrize("path", sorted((BRINGUP / "launch").glob("*.launch.py")), ids=lambda path: path.stem)
def test_a_launch_file_describes_a_launch_whose_files_are_there(path, monkeypatch):
    launch = Launch(monkeypatch)
    launch.run(path)
    assert Path(launch.default("config")).is_file()


def commanded(monkeypatch: pytest.MonkeyPatch, **arguments: str) -> list[str]:
    """Return what the launch file of the program starts."""
    launch = Launch(monkeypatch, **arguments)
    space = launch.run(BRINGUP / "launch" / "pretouch.launch.py")
    space["start"](None)
    (process,) = launch.made["ExecuteProcess"]
    return list(process["cmd"])


@pytest.mark.parametrize("path", sorted((BRINGUP / "config").glob("fr3_*.yaml")), ids=lambda path: path.stem)
def test_the_program_is_started_with_options_that_it_takes(path, monkeypatch):
    program, *words = commanded(monkeypatch, config=str(path))
    run: Any = cli._read(words, Console(stderr=True))
    assert program == "pretouch"
    assert isinstance(run, Run)
    check_options(run)
    options = run.connection
    assert (run.robot.arm, options.arm.sign, run.process.yes) == ("fr3", "by-robot", False)
    assert (options.desired, options.arm.torques.rpartition("/")[2]) == (
        path.stem.removeprefix("fr3_").replace("joystick", "twist").replace("moveit_servo", "trajectory"),
        "external_joint_torques",
    )


def test_options_of_each_kind_become_words(monkeypatch, tmp_path):
    mine = tmp_path / "mine.yaml"
    mine.write_text("no_skin: true\nconfirm_push: false\njoint_names: [a, b]\nseconds: 5\n")
    assert commanded(monkeypatch, config=str(mine), yes="true", program="/v/pretouch") == [
        "/v/pretouch", "run", "ros2", "--no-skin", "--joint-names", "a", "b", "--seconds", "5", "--yes",
    ]  # fmt: skip


def test_a_joystick_asks_on_the_topic_in_a_known_frame_often_enough(monkeypatch):
    launch = Launch(monkeypatch)
    launch.run(BRINGUP / "launch" / "joystick.launch.py")
    joy, teleop = launch.made["Node"]
    assert teleop["remappings"] == [("cmd_vel", TOPICS["twist"])]
    config = yaml(BRINGUP / "config" / "joystick.yaml")
    settings = config[teleop["name"]]["ros__parameters"]
    assert settings["publish_stamped_twist"] is True
    assert settings["require_enable_button"] is True
    assert settings["frame"] in RobotModel(robot_named("fr3")).links
    assert max(settings["scale_linear"].values()) <= PROFILES["pretouch"].task.speed_m_s
    period = 1 / config[joy["name"]]["ros__parameters"]["autorepeat_rate"]
    assert 3 * period < PROFILES["pretouch"].failure.desired_timeout_s


def test_moveit_servo_sends_velocities_to_the_topic_often_enough():
    servo = yaml(BRINGUP / "config" / "moveit_servo.yaml")["/**"]["ros__parameters"]["moveit_servo"]
    assert servo["command_out_type"] == "trajectory_msgs/JointTrajectory"
    assert servo["command_out_topic"] == TOPICS["trajectory"]
    assert servo["publish_joint_velocities"] is True
    assert 3 * servo["publish_period"] < PROFILES["pretouch"].failure.desired_timeout_s
