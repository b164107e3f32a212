"""A commander in place of the path: what it asks for is done within all limits, and what it cannot ask for is said."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch import desired
from pretouch.control.commander import _rotation_towards, rotation_about
from pretouch.desired import Desired, DesiredKind
from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch.recording.verify import verify
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Inputs, Mode
from tests.following_arm import DT, Arm, controller_of
from tests.recording.runs import Run, assert_replays


class Commanded(Arm):
    """An arm that follows its commands, driven by a commander: asks(time, arm) for each step; push(time) is felt."""

    def __init__(self, model: RobotModel, asks, seconds=4.0, name="paper", push=lambda _: (0.0, 0.0, 0.0)):
        super().__init__(model, Skin([], model), profile(name))
        self.begin, self.cycles = model.kinematics(self.q), []
        while self.time <= seconds:
            self.cycles.append(self.turn(push(self.time), desired=asks(self.time, self)))
        self.steps = [cycle.step for cycle in self.cycles]


TURN = rotation_about(np.array([0.0, 0.0, 1.0]), 0.3)


def test_a_twist_moves_the_hand_along_and_about(panda_model):
    linear, angular = np.array([0.0, 0.05, 0.02]), np.array([0.0, 0.0, 0.2])
    run = Commanded(panda_model, asks=lambda now, _: desired.twist(now, linear, angular))
    last = run.steps[-1]
    assert last.mode is Mode.TRACK
    np.testing.assert_allclose(last.ee_velocity, linear, atol=2e-3)
    J = panda_model.ee_jacobian(panda_model.kinematics(last.q))
    np.testing.assert_allclose((J @ last.command)[3:], angular, atol=0.03)
    np.testing.assert_allclose(last.desired_velocity, linear)


def test_without_an_angular_velocity_the_orientation_is_held_where_it_has_come_to(panda_model):
    spin = np.array([0.0, 0.0, 0.3])
    run = Commanded(panda_model, asks=lambda now, _: desired.twist(now, np.zeros(3), spin * (now < 2.5)), seconds=5.0)
    later = [panda_model.kinematics(step.q).rotation[panda_model.ee] for step in run.steps[-200:]]
    np.testing.assert_allclose(later[0], later[-1], atol=0.01)
    assert np.arccos((np.trace(later[-1] @ run.begin.rotation[panda_model.ee].T) - 1.0) / 2.0) > 0.2


@pytest.mark.parametrize("name", ["paper", "pretouch"])
def test_joint_velocities_are_done_joint_by_joint_within_their_limits(panda_model, name):
    wanted = np.array([0.1, -0.05, 0.0, 0.1, 0.0, 0.05, 9.0])
    run = Commanded(panda_model, asks=lambda now, _: desired.joint_velocities(now, wanted), seconds=2.0, name=name)
    np.testing.assert_allclose(run.steps[130].command[:6], wanted[:6], atol=1e-6)
    assert 0.5 < max(step.command[6] for step in run.steps) <= panda_model.description.qd_max[6]
    change = np.abs(np.diff([step.command for step in run.steps], axis=0))
    assert (change <= panda_model.description.qdd_max * DT * (1.0 + 1e-9)).all()


def test_a_pose_and_joint_positions_are_reached_and_kept(panda_model):
    def to_pose(now, run):
        T, ee = np.eye(4), panda_model.ee
        T[:3, 3] = run.begin.position[ee] + (0.05, 0.1, -0.05)
        T[:3, :3] = TURN @ run.begin.rotation[ee]
        return desired.pose(now, T)

    run = Commanded(panda_model, asks=to_pose, seconds=9.0)
    begin, end, ee = run.begin, panda_model.kinematics(run.q), panda_model.ee
    np.testing.assert_allclose(end.position[ee] - begin.position[ee], (0.05, 0.1, -0.05), atol=2e-3)
    np.testing.assert_allclose(end.rotation[ee], TURN @ begin.rotation[ee], atol=0.02)
    assert max(np.linalg.norm(step.ee_velocity) for step in run.steps) < 0.31

    q = panda_model.description.q_ready + 0.1
    joints = Commanded(panda_model, asks=lambda now, _: desired.joint_positions(now, q), seconds=8.0)
    np.testing.assert_allclose(joints.q, q, atol=2e-3)


def test_a_horizon_of_positions_is_followed_in_time(panda_model):
    q0 = panda_model.description.q_ready
    stamps = np.arange(0.0, 10.0, 0.2)
    q = q0 + 0.2 * np.sin(stamps)[:, None] * (np.arange(7) == 1)
    plan = desired.joint_positions(stamps, q)
    run = Commanded(panda_model, asks=lambda *_: plan, seconds=6.0)
    late = [step.q[1] - q0[1] - 0.2 * np.sin(step.stamp) for step in run.steps[300:]]
    assert np.abs(late).max() < 0.02


def test_a_motion_that_goes_stale_brings_the_arm_to_rest_says_so_and_is_taken_up_again(panda_model):
    def asks(now, _):
        return desired.joint_velocities(now if not 2.0 < now < 3.0 else 2.0, np.full(7, 0.1))

    run = Commanded(panda_model, asks=asks)
    stale = [step for step in run.steps if "desired motion ended" in step.reason]
    assert stale[0].stamp == pytest.approx(2.0 + run.controller.profile.failure.desired_timeout_s, abs=2 * DT)
    assert stale[0].mode is Mode.HOLD
    assert np.abs(stale[-1].command).max() < 1e-9
    change = np.abs(np.diff([step.command for step in run.steps], axis=0))
    assert (change <= panda_model.description.qdd_max * DT * (1.0 + 1e-9)).all()
    assert run.steps[-1].mode is Mode.TRACK


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda now: desired.twist(now, np.full(3, np.nan)), "Desired.number holds nan"),
        (lambda now: desired.twist(now, (1e9, 0.0, 0.0)), "Desired.number holds 1e"),
        (lambda now: desired.joint_velocities(now, np.zeros(6)), r"number has the shape \(1, 6\), not \(1, 7\)"),
        (lambda now: desired.pose(now, 2.0 * np.eye(4)), "no rotation"),
        (lambda now: desired.twist(now + 1e4, np.zeros(3)), "s in the future"),
        (lambda now: desired.twist((now, now), np.zeros((2, 3))), "do not increase"),
        (lambda _: desired.twist((-1e308, 1e308), np.zeros((2, 3))), "Desired.stamp holds -1e"),
        (lambda _: "left", "is of no kind"),
        (lambda now: Desired(7, np.array([now]), np.zeros((1, 6))), "is of no kind"),
        (lambda now: desired.refused(now, "two programs ask"), r"cannot be used \(two programs ask\)"),
    ],
)
def test_nonsense_is_a_named_hold(panda_model, wrong, said):
    run = Commanded(panda_model, asks=lambda now, _: wrong(now), seconds=0.5)
    assert run.steps[-1].mode is Mode.HOLD
    assert re.search(said, run.steps[-1].reason)
    assert np.abs(run.steps[-1].command).max() == 0.0


def test_rows_without_stamps_are_refused_where_they_are_made():
    with pytest.raises(ParameterError, match="2 stamps and 1 rows"):
        desired.twist((0.0, 1.0), np.zeros(3))


@given(st.integers(0, 2**32 - 1))
def test_a_far_orientation_is_approached_the_short_way(seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    R, angle = rotation_about(rng.permutation(np.eye(3))[0], rng.uniform(0, 3)), rng.choice([0.5, 2.0, np.pi])
    goal = rotation_about(axis, angle) @ R
    nearer = _rotation_towards(R, goal)
    np.testing.assert_allclose(nearer @ nearer.T, np.eye(3), atol=1e-9)
    left = np.arccos(np.clip((np.trace(goal @ nearer.T) - 1.0) / 2.0, -1.0, 1.0))
    assert left == pytest.approx(max(0.0, angle - 1.0) if angle > 1.0 else 0.0, abs=1e-5)


def test_a_recording_holds_what_was_asked_nonsense_too_and_replays_to_the_bit(panda_model, tmp_path):
    q = panda_model.description.q_ready
    plan = desired.joint_positions((0.5, 2.0), (q, q + 0.1))

    def asked(k: int, inputs: Inputs) -> Inputs:
        now = inputs.stamp
        motions = (
            None,
            plan,
            desired.twist(now, np.full(3, np.nan)),
            desired.refused(now, "two programs ask"),
            Desired(DesiredKind.TWIST, np.array([now, now + 0.1]), np.zeros((1, 5))),
            Desired(DesiredKind.TWIST, np.zeros(0), np.zeros((0, 6))),
            "left",
            desired.twist(now, (0.0, 0.05, 0.0)),
        )
        return replace(inputs, desired=motions[k // 40 % 8])

    recorded = assert_replays(Run(controller_of(panda_model, Skin([], panda_model))), tmp_path, asked, 450)
    unread = [kept.inputs is None for kept in recorded]
    assert [all(unread[k : k + 40]) for k in range(0, 320, 40)] == [False] * 6 + [True, False]
    assert verify(recorded).checked == unread.count(False)
    assert recorded[20].inputs.desired is None
    np.testing.assert_array_equal(recorded[60].inputs.desired.number, plan.number)
    assert recorded[300].inputs.desired.kind == DesiredKind.TWIST


def test_while_the_arm_yields_its_orientation_is_held_and_not_turned_to_what_is_asked(panda_model):
    far, ee = rotation_about(np.array([0.0, 0.0, 1.0]), 1.5), panda_model.ee

    def asks(now, run):
        T = np.eye(4)
        T[:3, 3], T[:3, :3] = run.begin.position[ee], far @ run.begin.rotation[ee]
        return desired.pose(now, T) if now > 2.9 else desired.twist(now, np.zeros(3))

    run = Commanded(panda_model, asks, push=lambda now: (0.0, 40.0 * (3.0 < now < 3.3), 0.0))
    yielding = [k for k, step in enumerate(run.steps) if step.mode is Mode.REACT]
    assert len(yielding) > 20
    goals = {run.cycles[k].after.memory.get("rotation_goal").tobytes() for k in yielding}
    assert len(goals) == 1
