"""A commander behind a topic: what it asks for is taken as it is meant, and what is wrong is said and holds the arm."""

import math
import re
from collections.abc import Callable
from contextlib import ExitStack
from time import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ros2.tests.arm_peer import speeds
from ros2.tests.asking import MESSAGES, NAMES, SLOW, publishing, trajectory, turned, twist
from ros2.tests.test_messages import Drawn

from pretouch.control.path import segment
from pretouch.controller import Controller
from pretouch.desired import Desired, DesiredKind
from pretouch.errors import ParameterError, RobotError
from pretouch.perception.scene_filter import no_fixtures
from pretouch.ports import NoUnits
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sound import sound_desired
from pretouch.types import ControlStep, Mode
from pretouch_ros2.commander import Ros2Commander
from pretouch_ros2.inputs import JointReading
from pretouch_ros2.messages import TWIST
from pretouch_ros2.params import ArmParams, Command
from pretouch_ros2.robot import Ros2Robot

R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""R_O_ee of the arm that is only made up."""
Q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])


class Told:
    """A commander that receives messages as from the node's thread."""

    def __init__(self, model: RobotModel, kind: Command, shared_clock: bool = True, **settings: Any) -> None:
        self._take: Callable[[Any, float, int], None]
        self.heard = SimpleNamespace(unreadable="")
        robot: Any = SimpleNamespace(
            params=ArmParams("on-robot", "base", shared_clock=shared_clock),
            joints=NAMES,
            orientation=lambda: R,
            measured=lambda: JointReading(0.0, Q, SLOW),
        )
        node: Any = SimpleNamespace(subscribe=self._subscribe)
        self.commander = Ros2Commander(kind, robot, model, node, **settings)

    def _subscribe(self, topic: str, kind: str, take: Callable[[Any, float, int], None]) -> Any:
        self._take = take
        return self.heard

    def __call__(self, message: Any, received: float = 5.0, writer: int = 1) -> Desired:
        self._take(message, received, writer)
        return self.commander()


@pytest.mark.parametrize(
    ("frame", "sideways"), [("world", False), ("panda_link0", False), ("base_link", False), ("panda_hand_tcp", True)]
)
def test_a_twist_in_any_known_frame_is_asked_for_in_the_base_frame(panda_model, frame, sideways):
    found = Told(panda_model, "twist", base_frame="base_link")(twist((0.1, 0.2, 0.3), (1, 2, 3), frame))
    assert found.kind is DesiredKind.TWIST
    assert found.number[0] == pytest.approx([-0.2, 0.1, 0.3, -2, 1, 3] if sideways else [0.1, 0.2, 0.3, 1, 2, 3])
    assert found.stamp == pytest.approx([5.0], abs=0.02)
    assert not found.refused


@pytest.mark.parametrize("frame", ["camera", "", "panda_link3", "x" * 500])
def test_an_unknown_frame_is_refused_by_name_and_the_next_twist_is_taken(panda_model, frame):
    told = Told(panda_model, "twist")
    found = told(twist((0.1, 0, 0), frame=frame))
    assert found.refused == (
        f"on /pretouch/twist twists are in the frame {frame[:80]!r}: give one of world, panda_link0, panda_hand_tcp"
    )
    assert not told(twist((0.1, 0, 0)), 5.1).refused


def test_velocities_of_a_trajectory_hold_from_its_points_on(panda_model):
    found = Told(panda_model, "trajectory")(trajectory(NAMES, (0.02, SLOW), (0.04, 2 * SLOW)))
    assert found.kind is DesiredKind.JOINT_VELOCITIES
    assert found.stamp == pytest.approx([5.02, 5.04])
    assert found.number.tolist() == [SLOW.tolist(), (2 * SLOW).tolist()]
    ahead = Told(panda_model, "trajectory")(trajectory(NAMES, (0.0, SLOW), at=time() + 0.3))
    assert ahead.stamp == pytest.approx([5.3], abs=0.05)


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (trajectory(NAMES[::-1], (0.0, SLOW)), "'panda_joint7' is in the place of 'panda_joint1': give panda_joint1, "),
        (trajectory((*NAMES[:6], "elbow"), (0.0, SLOW)), "'elbow' is in the place of .*: give .* in this order"),
        (trajectory((), (0.0, SLOW)), "'' is in the place of 'panda_joint1'"),
        (trajectory((*NAMES, "finger"), (0.0, SLOW)), "'finger' is in the place of ''"),
        (trajectory(NAMES), "has 0 points: give 1 to 1000"),
        (trajectory(NAMES, *[(k / 1000, SLOW) for k in range(1001)]), "has 1001 points"),
        (trajectory(NAMES, (0.0, [])), "0 joint velocities are requested: give 7, of panda_joint1"),
    ],
)  # fmt: skip
def test_a_trajectory_of_other_joints_or_without_velocities_is_refused(panda_model, message, said):
    assert re.search(said, Told(panda_model, "trajectory")(message).refused)


@pytest.mark.parametrize("off", [-30.0, 2.0])
def test_a_clock_that_differs_is_named_unless_ros_has_its_own(panda_model, off):
    found = Told(panda_model, "twist")(twist((0.1, 0, 0), at=time() + off))
    assert "behind this machine's time of day: set the clocks by NTP" in found.refused
    own = Told(panda_model, "twist", shared_clock=False)(twist((0.1, 0, 0), at=time() + off))
    assert (own.refused, own.stamp.tolist()) == ("", [5.0])


def test_a_message_that_only_comes_again_goes_stale_and_a_clock_set_back_is_named(panda_model):
    told, message = Told(panda_model, "twist"), twist((0.1, 0, 0))
    first = told(message)
    assert told(message, 6.0).stamp.tolist() == first.stamp.tolist()
    back = [told(twist((0.1, 0, 0), at=time() - 30.0 + k / 50), 6.0 + k / 50) for k in range(10)][-1]
    assert back.refused.startswith("/pretouch/twist is stamped no later than before, so it is not used: see whether")
    assert told.commander.notes == (f"{back.refused}.",)


def test_two_that_ask_at_once_are_refused_until_one_has_been_silent(panda_model):
    told, (here, there) = Told(panda_model, "trajectory"), (trajectory(NAMES, (0.0, qd)) for qd in (SLOW, -SLOW))
    assert not told(here, 5.0, writer=1).refused
    refusal = "several programs ask on /pretouch/joint_trajectory: run only one"
    assert told(there, 5.1, writer=2).refused == refusal
    assert told(there, 5.3, writer=2).refused
    assert not told(there, 5.7, writer=2).refused


def test_before_anything_was_asked_nothing_is(panda_model):
    told = Told(panda_model, "twist", topic="/joy")
    assert told.commander().refused == (
        "no geometry_msgs/TwistStamped was received on /joy yet: start what publishes it"
    )
    assert told.commander.notes == ()
    told.heard.unreadable = "cut off"
    assert told.commander.notes == ("cut off",)


def test_what_the_arm_is_told_is_no_commander(panda_model):
    with pytest.raises(RobotError, match="is where the arm's commands go: ask on another topic"):
        Told(panda_model, "trajectory", topic="/joint_trajectory_controller/joint_trajectory")
    with pytest.raises(ParameterError, match="give the full name of a topic"):
        Told(panda_model, "twist", topic="1st")


@pytest.mark.parametrize("asked", ["twist", "trajectory"])
def test_whatever_a_message_holds_is_taken_or_said(panda_model, asked):
    told, rng = Told(panda_model, asked, shared_clock=False), np.random.default_rng(0)
    odd, drawn = [math.nan, math.inf, -math.inf, 1e300, 0.0, 0.1], Drawn(MESSAGES, 1)
    for k in range(200):
        numbers = rng.choice(odd, 7)
        message = {
            "twist": twist(numbers[:3], numbers[3:6], str(rng.choice(["world", "panda_hand_tcp", "x"]))),
            "trajectory": trajectory(NAMES, (0.0, numbers), (float(rng.choice([0.0, 1.0])), numbers)),
        }[asked] if k % 2 else drawn.pair(told.commander.kind)[0]  # fmt: skip
        found = told(message, 5.0 + k)
        _, wrong = sound_desired(found, 7, 5.0 + k)
        assert wrong or np.isfinite(found.number).all()


def test_a_twist_drives_the_arm_by_its_torques_and_what_goes_wrong_holds_it_and_says_so(
    panda_model, arm, node, other, third
):
    topic, asked, said = "/pretouch/twist", {"frame": "panda_link0", "at": 0.0}, []
    x, y, z = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee]
    path, chosen = segment((x, y, z), (x, y + 0.4, z)), profile("pretouch:perception=none:failure.state_timeout_s=1")
    controller = Controller(panda_model, Skin((), panda_model), no_fixtures(), path, chosen)
    want, moved, held = "", 0, 0

    def made() -> Any:
        return twist((0.0, 0.1, 0.0), frame=asked["frame"], at=time() + asked["at"])

    with ExitStack() as opened:
        opened.enter_context(publishing(other, topic, TWIST, made))
        stages = iter([
            (lambda: asked.update(frame="camera"), "in the frame 'camera'"),
            (lambda: asked.update(at=-30.0), "is stamped no later than before"),
            (lambda: opened.enter_context(publishing(third, topic, TWIST, made)), "several programs ask on"),
        ])  # fmt: skip

        def done(step: ControlStep) -> bool:
            nonlocal want, moved, held
            moved += step.mode is Mode.TRACK and abs(step.ee_velocity[1]) > 0.08
            if not want and moved >= 30:
                worsen, want = next(stages)
                worsen()
            held = held + 1 if want and step.mode is Mode.HOLD and want in step.reason else 0
            if held < 60:
                return False
            assert not step.command.any()
            said.append(step.reason)
            asked.update(frame="panda_link0", at=0.0)
            want, moved, held = "", 0, 0
            return len(said) == 3

        params = ArmParams("by-robot", "base", torques="/external_joint_torques")
        robot = opened.enter_context(Ros2Robot(params, panda_model, node))
        robot.wait(10)
        commander = Ros2Commander("twist", robot, panda_model, node)
        robot.begin()
        steps = turned(controller, robot, NoUnits(), done, desired=commander)
    assert "the arm continues with a usable one" in said[0]
    assert len(said) == 3
    assert np.isfinite(steps[-1].residual).all()  # of external torques
    assert steps[-1].ee_position[1] - steps[0].ee_position[1] > 0.03
    assert speeds(arm.stop())[-20:].max() < 1e-6
