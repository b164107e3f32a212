"""What anticipation does where it could do harm: things that appear, hide, jump, come nearer and stand on all sides."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.control.motions import Mover
from tests.control.test_near import LEFT, PRETOUCH, A, hand_speed, on_its_way, to_wall
from tests.following_arm import DT, Arm

from pretouch.control.braking import braking_cap
from pretouch.control.joint_box import joint_limits
from pretouch.perception.closest import closest_points
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import QpOutcome, RobotState

TOLERANCE = 0.02
"""By how much the closing speed may be above the braking curve [m/s]: soft rows give a little, most where they
contradict each other or the arm stretches."""


def wall_ahead(arm: Arm, ahead: float) -> float:
    """Place y [m] of a wall which the unit on the left would read as so far ahead [m]."""
    y = arm.ee()[1]
    return y + ahead - to_wall(arm, y)


def touch(arm: Arm, y: float, cycles: int = 300) -> float:
    """Speed [m/s] at which the hand meets a wall."""
    for _ in range(cycles):
        step = arm.step(seen={LEFT: max(to_wall(arm, y), 0.0)})
        if to_wall(arm, y) <= 0.006:
            return float(hand_speed(arm, step)[1])
    return 0.0


@pytest.mark.parametrize("ahead", [0.07, 0.03])
def test_what_appears_just_ahead_at_full_speed_is_touched_no_faster_than_the_rest(panda_model, paper_skin, ahead):
    arm = on_its_way(panda_model, paper_skin)
    assert touch(arm, wall_ahead(arm, ahead)) <= A.touch_speed_max_m_s + 0.005


def test_a_unit_that_falls_silent_near_a_thing_lets_the_arm_go_no_faster_towards_it(panda_model, paper_skin: Skin):
    speeds = {}
    for name in ("pretouch", "pretouch:perception.keep_while_silent=no"):
        arm = on_its_way(panda_model, paper_skin, profile(name))
        y = wall_ahead(arm, 0.3)
        while to_wall(arm, y) > 0.06:
            step = arm.step(seen={LEFT: to_wall(arm, y)})
        before = hand_speed(arm, step)[1]
        after = [hand_speed(arm, arm.step(silent={LEFT: i * DT}))[1] for i in range(1, 40)]
        speeds[name] = max(after) - before
        assert abs(after[-1]) < 1e-3
    assert speeds["pretouch"] < 0.005
    assert speeds["pretouch:perception.keep_while_silent=no"] > 0.02


def test_before_a_hand_that_comes_the_standing_arm_retreats_slowly_and_rests_when_it_stops(panda_model, paper_skin):
    arm = on_its_way(panda_model, paper_skin)
    arm.run(300)
    y, stop, speeds = wall_ahead(arm, 0.6), wall_ahead(arm, 0.12), []
    for _ in range(350):
        y = max(y - 0.5 * DT, stop)
        speeds.append(hand_speed(arm, arm.step(seen={LEFT: max(to_wall(arm, y), 0.0)}))[1])
    assert min(speeds) >= -A.retreat_max_m_s - 0.005
    # back to the end of its path it goes once, and rests there
    assert max(speeds) < 0.1
    assert max(np.abs(speeds[-50:])) < 0.01
    moving = np.sign([v for v in speeds if abs(v) > 0.005])
    assert np.count_nonzero(np.diff(moving)) <= 2


def test_below_the_sensors_minimum_nothing_is_kept_once_the_unit_says_it_is_gone(panda_model, paper_skin):
    arm = on_its_way(panda_model, paper_skin)
    y = wall_ahead(arm, 0.2)
    while to_wall(arm, y) > 0.02:
        step = arm.step(seen={LEFT: max(to_wall(arm, y), 0.0)})
    assert hand_speed(arm, step)[1] < 0.12
    assert hand_speed(arm, arm.run(50)[-1])[1] > 0.25
    # and what a unit says is there for ever, dirt on it, leaves the arm the touch speed
    arm = on_its_way(panda_model, paper_skin)
    assert hand_speed(arm, arm.run(150, seen={LEFT: 0.0})[-1])[1] > 0.02


@pytest.mark.parametrize(("one", "other"), [(0.08, 0.4), (0.06, 0.12)])
def test_readings_that_jump_between_two_surfaces_leave_the_arm_calm(panda_model, paper_skin, one, other):
    arm, speeds = on_its_way(panda_model, paper_skin), []
    for i in range(70):
        speeds.append(hand_speed(arm, arm.step(seen={LEFT: other if i // 2 % 2 else one}))[1])
    assert np.abs(np.diff(speeds)).max() <= A.tighten_m_s2 * DT + 1e-6
    # the hand is never taken back for what does not come nearer
    assert min(speeds) > -0.05


def test_with_things_on_all_sides_the_arm_creeps_and_the_problem_is_solved(panda_model, paper_skin):
    arm = on_its_way(panda_model, paper_skin)
    steps = arm.run(100, seen=dict.fromkeys(range(7), 0.02))
    assert {s.qp.outcome for s in steps} == {QpOutcome.SOLVED}
    assert np.linalg.norm(hand_speed(arm, steps[-1])) < 2 * A.touch_speed_max_m_s


@settings(max_examples=12)
@given(st.integers(0, 10_000))
def test_in_any_posture_nothing_that_stands_is_met_faster_than_the_curve_allows(panda_model: RobotModel, seed: int):
    rng, model = np.random.default_rng([1000, seed]), panda_model
    limits, mover = joint_limits(model, 0.01, DT), Mover(model, PRETOUCH)
    span = limits.q_max - limits.q_min
    # near a limit or a stretched arm as often as not
    q = np.clip(limits.q_min + span * rng.uniform(-0.1, 1.1, 7), limits.q_min, limits.q_max)
    qd, start = np.zeros(7), model.kinematics(q)
    hand = start.position[model.ee]
    things = hand + rng.normal(0.0, 0.2, (3, 3))
    course = 0.3 * (things[0] - hand) / np.linalg.norm(things[0] - hand)
    for _ in range(80):
        kin = model.kinematics(q)
        near = closest_points(kin, model.body, kin.position[model.ee], np.arange(3), things, np.eye(3))
        robot = RobotState(0.0, q, qd, q, qd, np.zeros(7), None)
        motion = mover.step(kin, robot, near, course, start.rotation[model.ee])
        command = motion.qp.qd
        assert motion.qp.outcome is QpOutcome.SOLVED
        assert np.all(np.abs(command - qd) <= limits.qdd_max * DT + 1e-9)
        assert np.all(np.abs(command) <= limits.qd_max + 1e-9)
        for m in range(3):
            J = model.jacobian(kin, int(near.link[m]), near.body_point[m])[:3]
            cap = braking_cap(
                float(near.body_distance[m]), A.touch_speed_max_m_s, A.deceleration_m_s2, A.latency_s, A.margin_m
            )
            speed, before = near.direction[m] @ J @ command, near.direction[m] @ J @ qd
            assert speed <= max(cap, before) + TOLERANCE
        q, qd = np.clip(q + command * DT, limits.q_min, limits.q_max), command
