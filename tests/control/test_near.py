"""Anticipation in the whole control step, over an arm that follows its commands exactly."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.control.motions import Mover
from tests.following_arm import DT, Arm, on_its_way

from pretouch.control.approach import Restricted, rows_of
from pretouch.control.braking import braking_cap
from pretouch.control.joint_box import joint_limits
from pretouch.errors import ParameterError
from pretouch.perception.closest import closest_points
from pretouch.profiles import PROFILES, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode, QpOutcome, RobotState

PRETOUCH = PROFILES["pretouch"]
TOUCHING = profile("pretouch:approach.untouched_s=0")
"""It may touch what it sees."""
LEFT = 0
"""The unit of the paper's skin that looks along +y in the ready posture, the way the arm goes."""
A = PRETOUCH.approach
ACROSS = A.tangential


def hand_speed(arm: Arm, step: ControlStep) -> np.ndarray:
    return (arm.model.ee_jacobian(arm.model.kinematics(step.q)) @ step.command)[:3]


def to_wall(arm: Arm, y: float) -> float:
    """Reading [m] of the unit that looks along +y at a wall at y."""
    kin, unit = arm.model.kinematics(arm.q), arm.skin.units[LEFT]
    link = arm.model.link_index(unit.link)
    sensor = kin.position[link] + kin.rotation[link] @ unit.T_link_sensor[:3, 3]
    beam = kin.rotation[link] @ unit.T_link_sensor[:3, 2]
    return float((y - sensor[1]) / beam[1])


def run_into_a_wall(arm: Arm, cycles: int, ahead: float = 0.25) -> list[ControlStep]:
    y = arm.ee()[1] + ahead
    steps = []
    for _ in range(cycles):
        d = to_wall(arm, y)
        steps.append(arm.step(seen={LEFT: max(d, 0.0)}))
        if d < 0.005:
            break
    return steps


def approach(arm: Arm, step: ControlStep) -> float:
    """Velocity [m/s] of the closest body point of the first row towards its obstacle."""
    o, m = step.obstacles, step.restricted[0]
    kin = arm.model.kinematics(step.q)
    J = arm.model.jacobian(kin, int(o.link[m]), o.body_point[m])[:3]
    return float(o.direction[m] @ J @ step.command)


@pytest.mark.parametrize("shape", [(2, 6), (1, 7)])
def test_rows_of_a_wrong_shape_are_refused(shape: tuple[int, int]):
    allowed = Restricted(np.zeros(shape), np.zeros(2), np.zeros(2, np.int64), 1.0)
    with pytest.raises(ParameterError, match=r"rows are G .*: G is \(R, 7\), h is \(R,\)"):
        rows_of(allowed, 7)


def test_towards_a_wall_the_arm_keeps_the_braking_curve_and_comes_to_touch(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin, TOUCHING)
    steps = run_into_a_wall(arm, 600)
    near = [s for s in steps if len(s.restricted)]
    for before, step in pairwise(near):
        cap = braking_cap(
            float(step.obstacles.body_distance[0]), A.touch_speed_m_s, A.deceleration_m_s2, A.latency_s, A.margin_m
        )
        v = approach(arm, step)
        # soft rows give a little
        assert v <= max(cap, approach(arm, before) - A.tighten_m_s2 * DT) + 0.003
        assert {step.mode, before.mode} == {Mode.TRACK}
    assert approach(arm, near[0]) > 0.25
    # v_c = 0.25 * 65 N / sqrt(mu 75 N/mm), 1/mu = 1/4.4 + 1/m_R, is 0.044 m/s at m_R = 3 kg
    assert approach(arm, near[-1]) == pytest.approx(0.044, abs=0.008)
    # 0.25 m less the hand's 0.1: it took the braking of 0.3 m/s at 0.3 m/s^2 and less than a second more
    assert len(steps) * DT < 0.9 + 1.6


def test_when_sight_is_lost_the_arm_speeds_up_no_faster_than_rows_loosen(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    steps = run_into_a_wall(arm, 100)
    before = hand_speed(arm, steps[-1])[1]
    assert before < 0.15
    for _ in range(40):
        after = hand_speed(arm, arm.step())[1]
        assert after - before < A.loosen_m_s2 * DT + 0.002
        before = after
    assert before > 0.25


def test_a_push_away_from_an_obstacle_is_followed_at_once(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    y = arm.ee()[1] + 0.13
    for _ in range(60):
        arm.step(seen={LEFT: max(to_wall(arm, y), 0.0)})
    for _ in range(30):
        step = arm.step(force=(0.0, -60.0, 0.0), seen={LEFT: max(to_wall(arm, y), 0.0)})
    assert step.mode is Mode.REACT
    assert hand_speed(arm, step)[1] == pytest.approx(step.reaction_velocity[1], abs=0.01)
    assert step.reaction_velocity[1] < -0.2


def test_near_a_thing_beside_it_the_arm_does_not_slide_past_at_full_speed(panda_model: RobotModel, paper_skin: Skin):
    speeds = {}
    for name in ("pretouch", "pretouch:approach.tangential=none"):
        arm = on_its_way(panda_model, paper_skin, profile(name))
        for _ in range(40):
            # a unit of the hand that looks along x sees something all the time
            step = arm.step(seen={2: 0.05})
        d = float(step.obstacles.body_distance.min())
        speeds[name] = abs(hand_speed(arm, step)[1])
    assert speeds["pretouch:approach.tangential=none"] > 0.28
    cap = ACROSS.speed_m_s + d / ACROSS.distance_m * (0.3 - ACROSS.speed_m_s)
    assert d < 0.07
    assert speeds["pretouch"] < cap + 0.015


def test_on_a_blocked_path_the_phase_waits(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    arm.run(60, seen={LEFT: 0.0})
    begun = arm.state.phase
    step = arm.run(200, seen={LEFT: 0.0})[-1]
    assert step.mode is Mode.TRACK
    assert step.path_phase - begun < 0.15
    assert arm.run(100)[-1].reason == "Moving as requested."


def test_the_null_space_moves_the_elbow_away_and_the_hand_stays(panda_model: RobotModel):
    elbow, gaps = panda_model.link_index("panda_link4"), {}
    for name in ("pretouch", "pretouch:null_space=none"):
        params = replace(profile(name), task=replace(profile(name).task, mid_joint_gain=1e-3, mid_joint_time_s=1e5))
        q, qd, mover = panda_model.description.q_ready.copy(), np.zeros(7), Mover(panda_model, params)
        start = panda_model.kinematics(q)
        thing = start.position[elbow] + np.array([0.0, 0.2, 0.0])
        for _ in range(100):
            kin = panda_model.kinematics(q)
            near = closest_points(
                kin, panda_model.body, kin.position[panda_model.ee], np.zeros(1, np.int64), thing[None], np.eye(3)[:1]
            )
            robot = RobotState(0.0, q, qd, q, qd, np.zeros(7), None)
            qd = mover.step(kin, robot, near, np.zeros(3), start.rotation[panda_model.ee]).qp.qd
            q = q + qd * DT
        gaps[name] = float(near.body_distance[0])
        np.testing.assert_allclose(kin.position[panda_model.ee], start.position[panda_model.ee], atol=1e-3)
    assert gaps["pretouch"] > gaps["pretouch:null_space=none"] + 0.005


# where it could do harm: things that appear, hide, jump, come nearer and stand on all sides


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
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    assert touch(arm, wall_ahead(arm, ahead)) <= A.touch_speed_m_s + 0.005


def test_a_unit_that_falls_silent_near_a_thing_lets_the_arm_go_no_faster_towards_it(panda_model, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin, TOUCHING)
    y = wall_ahead(arm, 0.3)
    while to_wall(arm, y) > 0.06:
        step = arm.step(seen={LEFT: to_wall(arm, y)})
    before = hand_speed(arm, step)[1]
    after = [hand_speed(arm, arm.step(silent={LEFT: i * DT}))[1] for i in range(1, 40)]
    assert max(after) - before < 0.005
    assert abs(after[-1]) < 1e-3


@pytest.mark.parametrize("cycles", [200, 1000])
def test_before_what_is_seen_the_arm_stops_and_waits(panda_model, paper_skin: Skin, cycles: int):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    y = wall_ahead(arm, 0.2)
    steps = [arm.step(seen={LEFT: max(to_wall(arm, y), 0.0)}) for _ in range(cycles)]
    assert min(step.obstacles.body_distance.min() for step in steps) == pytest.approx(A.margin_m, abs=0.002)
    # for longer than `untouched_s`, though it reads a distance below its minimum all that time
    assert max(abs(hand_speed(arm, step)[1]) for step in steps[150:]) < 0.01
    assert {step.mode for step in steps} == {Mode.TRACK}
    if cycles == 200:
        assert hand_speed(arm, arm.run(50)[-1])[1] > 0.25, "it goes on when its way is seen empty"


def test_before_a_hand_that_comes_the_standing_arm_retreats_slowly_and_rests_when_it_stops(panda_model, paper_skin):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
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


def test_what_a_unit_says_is_there_for_ever_dirt_on_it_holds_the_arm(panda_model, paper_skin):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    assert abs(hand_speed(arm, arm.run(150, seen={LEFT: 0.0})[-1])[1]) < 0.03
    assert hand_speed(arm, arm.run(50)[-1])[1] > 0.25


@pytest.mark.parametrize(("one", "other"), [(0.08, 0.4), (0.06, 0.12)])
def test_readings_that_jump_between_two_surfaces_leave_the_arm_calm(panda_model, paper_skin, one, other):
    arm, speeds = on_its_way(panda_model, paper_skin, PRETOUCH), []
    for i in range(70):
        speeds.append(hand_speed(arm, arm.step(seen={LEFT: other if i // 2 % 2 else one}))[1])
    assert np.abs(np.diff(speeds)).max() <= A.tighten_m_s2 * DT + 1e-6
    # the hand is never taken back for what does not come nearer
    assert min(speeds) > -0.05


def test_with_things_on_all_sides_the_arm_creeps_and_the_problem_is_solved(panda_model, paper_skin):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)
    steps = arm.run(100, seen=dict.fromkeys(range(7), 0.02))
    assert {s.qp.outcome for s in steps} == {QpOutcome.SOLVED}
    assert np.linalg.norm(hand_speed(arm, steps[-1])) < 2 * A.touch_speed_m_s


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
                float(near.body_distance[m]), A.touch_speed_m_s, A.deceleration_m_s2, A.latency_s, A.margin_m
            )
            speed, before = near.direction[m] @ J @ command, near.direction[m] @ J @ qd
            assert speed <= max(cap, before) + TOLERANCE
        q, qd = np.clip(q + command * DT, limits.q_min, limits.q_max), command
