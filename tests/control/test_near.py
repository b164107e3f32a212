"""Anticipation in the whole control step, over an arm that follows its commands exactly."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.control.motions import Mover
from tests.following_arm import DT, Arm

from pretouch.control.approach import Restricted, rows_of
from pretouch.control.braking import braking_cap
from pretouch.errors import ParameterError
from pretouch.params import NullSpaceMotion
from pretouch.perception.closest import closest_points
from pretouch.profiles import PROFILES, Profile, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode, RobotState, no_obstacles

PRETOUCH = PROFILES["pretouch"]
LEFT = 0
"""The unit of the paper's skin that looks along +y in the ready posture, the way the arm goes."""
A = PRETOUCH.approach
ACROSS = A.tangential


def on_its_way(model: RobotModel, skin: Skin, params: Profile = PRETOUCH) -> Arm:
    arm = Arm(model, skin, params)
    arm.run(150)
    return arm


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


def test_every_part_of_ours_can_be_left_out_alone():
    for switch in ("reckon_below_minimum", "keep_while_silent"):
        assert getattr(PRETOUCH.perception, switch) is True
        assert getattr(PROFILES["paper"].perception, switch) is False
        assert getattr(profile(f"pretouch:perception.{switch}=no").perception, switch) is False
    for part in ("closing", "outside"):
        assert getattr(PRETOUCH.perception, part) is not None
        assert getattr(PROFILES["paper"].perception, part) is None
        assert getattr(profile(f"pretouch:perception.{part}=none").perception, part) is None
    for part in ("effective_mass", "closing_deadband_m_s", "tangential"):
        assert getattr(A, part) is not None
        assert getattr(profile(f"pretouch:approach.{part}=none").approach, part) is None
    assert isinstance(PRETOUCH.null_space, NullSpaceMotion)
    assert profile("pretouch:null_space=none").null_space is None


@pytest.mark.parametrize("shape", [(2, 6), (1, 7)])
def test_rows_of_a_wrong_shape_are_refused(shape: tuple[int, int]):
    allowed = Restricted(np.zeros(shape), np.zeros(2), np.zeros(2, np.int64), 1.0)
    with pytest.raises(ParameterError, match=r"rows are G .*: G is \(R, 7\), h is \(R,\)"):
        rows_of(allowed, 7)


def test_towards_a_wall_the_arm_keeps_the_braking_curve_and_comes_to_touch(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin)
    steps = run_into_a_wall(arm, 600)
    near = [s for s in steps if len(s.restricted)]
    for before, step in pairwise(near):
        cap = braking_cap(
            float(step.obstacles.body_distance[0]), A.touch_speed_max_m_s, A.deceleration_m_s2, A.latency_s, A.margin_m
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
    arm = on_its_way(panda_model, paper_skin)
    steps = run_into_a_wall(arm, 100)
    before = hand_speed(arm, steps[-1])[1]
    assert before < 0.15
    for _ in range(40):
        after = hand_speed(arm, arm.step())[1]
        assert after - before < A.loosen_m_s2 * DT + 0.002
        before = after
    assert before > 0.25


def test_a_push_away_from_an_obstacle_is_followed_at_once(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin)
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
        assert len(step.restricted) == 1
        d = float(step.obstacles.body_distance[0])
        speeds[name] = abs(hand_speed(arm, step)[1])
    assert speeds["pretouch:approach.tangential=none"] > 0.28
    cap = ACROSS.speed_m_s + d / ACROSS.distance_m * (0.3 - ACROSS.speed_m_s)
    assert d < 0.07
    assert speeds["pretouch"] < cap + 0.01


def test_on_a_blocked_path_the_phase_waits(panda_model: RobotModel, paper_skin: Skin):
    arm = on_its_way(panda_model, paper_skin)
    arm.run(60, seen={LEFT: 0.0})
    begun = arm.state.phase
    step = arm.run(200, seen={LEFT: 0.0})[-1]
    assert step.mode is Mode.TRACK
    assert step.path_phase - begun < 0.15
    steps = arm.run(100)
    assert steps[-1].reason == "Moving as asked."


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


def test_joint_velocities_asked_for_are_the_answer_within_the_limits(panda_model: RobotModel, paper_skin: Skin):
    arm = Arm(panda_model, paper_skin)
    wanted = np.array([0.02, -0.01, 0.03, 0.0, 0.01, -0.02, 0.01])
    for params in (PROFILES["paper"], PRETOUCH):
        motion = Mover(panda_model, params).step(
            panda_model.kinematics(arm.q), arm.robot(), no_obstacles(),
            np.array([0.0, 0.3, 0.0]), np.eye(3), wanted,
        )  # fmt: skip
        np.testing.assert_allclose(motion.qp.qd, wanted, atol=1e-12)
