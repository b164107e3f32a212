"""Motions by sines and ways, and planned ones against their limits, looked at more often than the planner does."""

import re
from dataclasses import replace
from functools import cache
from itertools import cycle, pairwise, product

import numpy as np
import pytest

from pretouch.calibration.motion.limits import PlanLimits, PlanParams
from pretouch.calibration.motion.plan import Plan, Swing
from pretouch.calibration.motion.planner import approach, plan_motion
from pretouch.errors import CalibrationError
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import capsule_ends, kinematics_of, self_distances

QUICK = PlanParams(poses=2, swing_s=6.0)
STARTS = {
    "ready": [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4],
    "aside": [1.8, 0.2, -0.4, -1.8, 0.3, 2.0, -1.0],
    "upright": [-0.5, -0.3, 0.2, -1.2, -0.2, 1.4, 0.0],
}


@cache
def model(name: str) -> RobotModel:
    return RobotModel({"panda": panda, "fr3": fr3}[name]())


@cache
def planned(name: str) -> Plan:
    return plan_motion(model(name))


def envelope_at(arm: RobotModel, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Largest speeds (T, n) towards the end that each joint moves to."""
    e = arm.description.envelope
    if e is None:
        return np.full(q.shape, np.inf)
    up = -e.offset + np.sqrt(np.maximum(0.0, e.slope * (e.q_upper - q)))
    down = -e.offset + np.sqrt(np.maximum(0.0, e.slope * (q - e.q_lower)))
    return np.maximum(0.0, np.where(qd > 0, up, down))


def assert_kept(arm: RobotModel, plan: Plan, params: PlanParams, rate: float = 1000.0) -> None:
    samples, description = plan.sampled(rate), arm.description
    assert np.all(samples.q >= arm.q_min + params.margin_rad)
    assert np.all(samples.q <= arm.q_max - params.margin_rad)
    assert np.all(np.abs(samples.qd) <= params.speed_share * description.qd_max)
    assert np.all(np.abs(samples.qd) <= params.speed_share * envelope_at(arm, samples.q, samples.qd) + 1e-9)
    assert np.all(np.abs(samples.qdd) <= params.speed_share * description.qdd_max)
    ends = capsule_ends(arm, kinematics_of(arm, samples.q))
    speed = np.linalg.norm(np.diff(ends, axis=0), axis=-1) / np.diff(samples.time)[:, None, None]
    assert speed.max() <= params.speed_m_s
    radius = arm.capsules.radius
    moving = arm.capsules.link > arm.link_index(f"{description.name}_link0")
    assert (ends[..., 2].min(axis=2) - radius)[:, moving].min() >= params.floor_m + params.clearance_m
    # two parts at that speed come nearer to each other by no more than twice the way of one
    stride = max(1, round(rate / 250.0))
    coarse = self_distances(arm, ends[::stride]).min(axis=1)
    near = np.repeat(coarse < params.clearance_m + 2.0 * params.speed_m_s * stride / rate, stride)[: len(ends)]
    assert self_distances(arm, ends[near]).min(initial=np.inf) >= params.clearance_m
    assert coarse.min() >= params.clearance_m


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "fr3"])
def test_the_motion_planned_by_default_keeps_all_limits_each_millisecond(name: str):
    assert_kept(model(name), planned(name), PlanParams())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "start", "variant"),
    [(name, *rest) for name, rest in zip(cycle(("panda", "fr3")), product(STARTS, (0, 1, 5)), strict=False)],
)
def test_motions_from_elsewhere_and_with_other_limits_keep_them(name: str, start: str, variant: int):
    params = replace(
        QUICK, variant=variant, speed_m_s=0.7 + 0.2 * variant, speed_share=0.5 + 0.1 * variant,
        clearance_m=0.03 - 0.005 * variant, floor_m=-0.1 * variant,
    )  # fmt: skip
    plan = plan_motion(model(name), params, np.array(STARTS[start]))
    assert_kept(model(name), plan, params)
    assert min(swing.amplitude.max() for swing in plan.swings) > 0.05
    np.testing.assert_array_equal(plan.start, STARTS[start])


@pytest.mark.parametrize("name", ["panda", "fr3"])
def test_it_begins_and_ends_at_the_start_and_swings_in_each_pose(name: str):
    plan, params = planned(name), PlanParams()
    np.testing.assert_array_equal(plan.start, model(name).description.q_ready)
    np.testing.assert_array_equal(plan.postures[-1], plan.start)
    assert 45.0 < plan.duration < 65.0
    assert len(stands(plan)) == 1 + params.poses == 1 + len(plan.swings)
    for swing, pose in zip(plan.swings, stands(plan)[1:], strict=True):
        assert swing.duration == params.swing_s
        for time in np.linspace(swing.begin - 1.5, swing.begin, 5):
            np.testing.assert_allclose(plan.at(time), [pose, np.zeros(7)], atol=1e-12)


def stands(plan: Plan) -> list[np.ndarray]:
    """Postures in which the arm stands, the start first."""
    return [q for q, after in pairwise(plan.postures) if np.array_equal(q, after)][::2]


def test_no_two_joints_swing_at_one_frequency():
    for swing in planned("panda").swings:
        tones = np.sort(swing.frequency.ravel())
        assert np.diff(tones).min() > 0.02
        assert 0.2 <= tones[0] <= tones[-1] <= 1.2


@pytest.mark.slow
def test_the_same_request_gives_the_same_motion_and_another_variant_another(panda_model: RobotModel):
    first, again = plan_motion(panda_model, QUICK), plan_motion(panda_model, QUICK)
    np.testing.assert_array_equal(first.sampled(50.0).q, again.sampled(50.0).q)
    assert not np.array_equal(plan_motion(panda_model, replace(QUICK, variant=1)).postures, first.postures)


@pytest.mark.parametrize("name", ["panda", "fr3"])
def test_every_joint_turns_and_links_stand_at_several_angles_to_gravity(name: str):
    arm, plan = model(name), planned(name)
    assert np.rad2deg(np.ptp(plan.sampled(50.0).q, axis=0)).min() > 20.0
    up = np.array(
        [arm.kinematics(q).rotation[:, 2] for q in stands(plan)]
    )  # (stands, links, 3): where each feels gravity
    spread = np.rad2deg(np.arccos(np.clip(np.einsum("ilx,jlx->ijl", up, up), -1.0, 1.0))).max(axis=(0, 1))
    assert spread[arm.moved_by.sum(axis=1) > 1].min() > 10.0


def test_the_report_says_what_time_and_room_are_needed(panda_model: RobotModel):
    plan = planned("panda")
    words = re.fullmatch(
        r"\d\d s; parts move at up to (\S+) m/s\.\n"
        r"The arm needs the space x (\S+) to (\S+), y (\S+) to (\S+), z (\S+) to (\S+) m \(base frame\)\.",
        PlanLimits(panda_model, PlanParams()).report(plan),
    )
    speed, *box = map(float, words.groups())
    tcp = kinematics_of(panda_model, plan.sampled(20.0).q).position[:, panda_model.ee]
    assert np.all(tcp > box[::2])
    assert np.all(tcp < box[1::2])
    assert 0.3 < speed <= 0.7


def test_the_way_to_its_start_keeps_clear_and_within_limits(panda_model: RobotModel):
    plan = planned("panda")
    q = np.array(STARTS["aside"])
    way = approach(panda_model, q, plan.start, PlanParams())
    np.testing.assert_array_equal(way.start, q)
    np.testing.assert_array_equal(way.postures[-1], plan.start)
    assert_kept(panda_model, way, PlanParams(margin_rad=0.0))


def test_a_way_through_the_arm_itself_is_refused(panda_model: RobotModel):
    """From the hand on one side of the forearm to the other, past it."""
    side = panda_model.description.q_ready.copy()
    side[4:] = 1.5, 0.6, -1.5
    other = side * [1, 1, 1, 1, -1, 1, -1]
    with pytest.raises(CalibrationError, match=r"cannot go straight .* by hand"):
        approach(panda_model, side, other, PlanParams())


@pytest.mark.parametrize(
    ("params", "start", "words"),
    [
        (PlanParams(margin_rad=1.6), None, r"uses up the whole range of .*joint4.* choose a smaller margin_rad"),
        (PlanParams(clearance_m=0.09), None, r"No motion can begin at .* come within .* of each other"),
        (PlanParams(floor_m=0.5), None, r"No motion can begin at .*the arm and the floor"),
        (PlanParams(), [0.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0], "No motion can begin at"),
        (PlanParams(), [0.0, 0.0], "give 7 finite joint positions"),
        (PlanParams(), [np.nan] * 7, "give 7 finite joint positions"),
        (PlanParams(), [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 2.85], "joint7 comes closer to its limit than 0.1 rad"),
        (PlanParams(speed_m_s=0.01), None, r"only 0 can be reached .* but 4 are needed: .* or a higher speed"),
    ],
)
def test_an_impossible_request_says_why(panda_model: RobotModel, params: PlanParams, start, words: str):
    with pytest.raises(CalibrationError, match=words):
        plan_motion(panda_model, params, None if start is None else np.array(start))


TONES = np.array([[0.3, 0.5], [0.9, 1.1]])


def swing(begin: float = 3.0, duration: float = 6.0) -> Swing:
    return Swing(begin, duration, 1.5, np.array([[0.3, 0.2], [0.1, 0.05]]), TONES, np.array([[0.1, 2.0], [4.0, 5.0]]))


def plan() -> Plan:
    """Stand, go, stand, swing there, stand, and go back."""
    away = [0.5, -0.7]
    return Plan(
        np.array([0.0, 1.0, 2.5, 3.0, 9.0, 10.0, 12.0]),
        np.array([[0.0, 1.0], [0.0, 1.0], away, away, away, away, [0.0, 1.0]]),
        (swing(),),
    )


def test_velocities_and_accelerations_are_derivatives_and_do_not_jump():
    samples = plan().sampled(10_000.0)
    for values, slopes, within in ((samples.q, samples.qd, 1e-6), (samples.qd, samples.qdd, 0.01)):
        np.testing.assert_allclose(slopes[1:-1], np.gradient(values, samples.time, axis=0)[1:-1], atol=within)
    assert np.abs(np.diff(samples.qdd, axis=0)).max() < 0.01


@pytest.mark.parametrize("time", [-5.0, 0.0, 12.0, 100.0])
def test_it_is_at_rest_at_its_ends_and_beyond(time):
    q, qd = plan().at(time)
    np.testing.assert_allclose(q, plan().start, atol=1e-12)
    np.testing.assert_allclose(qd, 0.0, atol=1e-12)


def test_a_way_between_knots_is_straight_and_turns_nowhere():
    q = plan().sampled(100.0).q[100:251]
    np.testing.assert_allclose(np.interp(q[:, 0], [0.0, 0.5], [1.0, -0.7]), q[:, 1], atol=1e-12)
    assert np.all(np.diff(q[:, 0]) >= 0.0)


def test_a_swing_is_the_sum_of_its_sines_between_its_fades():
    one = swing(begin=0.0)
    time = np.array([2.0, 3.3, 4.4])
    angle = 2 * np.pi * TONES[None] * time[:, None, None] + one.phase
    np.testing.assert_allclose(one.states(time)[0], (one.amplitude * np.sin(angle)).sum(axis=1))


def test_sampling_includes_both_ends_at_no_less_than_the_rate():
    samples = plan().sampled(7.3)
    assert (samples.time[0], samples.time[-1]) == (0.0, 12.0)
    assert np.diff(samples.time).max() <= 1 / 7.3
    np.testing.assert_allclose(samples.q[33], plan().at(samples.time[33])[0])
