"""The shield benchmark: what it counts, its commanders, its filters, and a scaled-down run."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pretouch import desired
from pretouch.control.joint_box import JointLimits
from pretouch.desired import DesiredKind
from pretouch.sim.plant import Touch
from pretouch_lab.bench import shield
from pretouch_lab.bench.avoidance_scenes import arm
from pretouch_lab.bench.obstacle import Ball, nearest
from pretouch_lab.bench.shield import AtPerson, Tracking, asked_velocity, breaks_limits, speed_bound, touches_of
from pretouch_lab.trial import Record

READY = arm().description.q_ready
KIN = arm().kinematics(READY)
EE_JACOBIAN = arm().ee_jacobian(KIN)


def scene(path=None):
    return SimpleNamespace(setup=SimpleNamespace(model=arm(), path=path), shape=lambda place: Ball(place, 0.1))


def test_a_limit_is_broken_beyond_rounding():
    limits = JointLimits(np.array([-1.0]), np.array([1.0]), np.array([2.0]), np.array([10.0]), 0.01)

    tried = [
        (1.0, 1.9, 2.0), (0.0, 0.0, 0.1), (1.0 + 1e-6, 1.9, 2.0), (0.0, 2.0, 2.0 + 1e-6), (0.0, 0.0, 0.1 + 1e-6),
        (0.0, 0.0, -0.2), (0.0, 0.0, np.nan),
    ]  # fmt: skip
    q, before, command = np.array(tried).T[..., None]
    assert breaks_limits(q, before, command, limits).tolist() == [False] * 2 + [True] * 5


def test_what_is_asked_is_a_velocity_of_the_end_effector():
    assert_allclose(asked_velocity(desired.twist(1.0, (0.1, 0.2, 0.3)), arm(), KIN), (0.1, 0.2, 0.3))
    turning = desired.joint_velocities(1.0, (1.0, 0, 0, 0, 0, 0, 0))
    x, y, _ = KIN.position[arm().ee]
    assert_allclose(asked_velocity(turning, arm(), KIN), (-y, x, 0.0), atol=1e-12)  # 1 rad/s about the base's z


def test_one_that_means_harm_comes_nearer():
    place, kinds = np.array([0.8, 0.0, 0.5]), set()
    before = nearest(KIN, arm().body, Ball(place, 0.1)).distance
    for seed in range(6):
        goal = AtPerson(scene(), seed)(1.0, KIN, place)
        kinds.add(goal.kind)
        to_joints = np.eye(7) if goal.kind is DesiredKind.JOINT_VELOCITIES else np.linalg.pinv(EE_JACOBIAN[:3])
        after = arm().kinematics(READY + 0.02 * to_joints @ goal.number[0, : to_joints.shape[1]])
        assert nearest(after, arm().body, Ball(place, 0.1)).distance < before + 1e-4
    assert len(kinds) == 2


def test_an_ordinary_commander_goes_on_by_the_clock():
    path = SimpleNamespace(closed=False, length=1.0, point=lambda phase: np.array([phase, 0.0, 0.0]))
    commander = Tracking(scene(path))
    assert_allclose(commander.goal(2.0), (0.4, 0.0, 0.0))
    assert_allclose(commander.goal(9.0), (1.0, 0.0, 0.0))
    x, y, z = KIN.position[arm().ee]
    asked = commander(2.0, KIN, np.zeros(3)).number[0, :3]
    wanted = np.array([0.2 + 2.0 * (0.4 - x), -2.0 * y, -2.0 * z])
    assert_allclose(asked, wanted * min(1.0, 0.5 / np.linalg.norm(wanted)), atol=1e-9)


def test_the_bound_is_the_braking_curve_where_it_was_thought_and_the_drives():
    # sqrt((0.6 * 0.06)^2 + 0.04^2 + 2 * 0.6 * (0.02 - 0.01)) - 0.6 * 0.06
    drives = 4.0 / (50.0 * np.e)
    assert speed_bound(0.02) == pytest.approx(np.sqrt(0.036**2 + 0.0016 + 0.012) - 0.036 + drives)
    assert speed_bound(0.01) == pytest.approx(0.04 + drives)  # within the margin


def recorded(mistake, unknown=()):
    """Return a trial of a standing arm: a ball comes at its hand and touches it at 1 s with 0.2 m/s."""
    model, kin = arm(), KIN
    hand = model.link_index("panda_hand")
    body = model.body.of_links(np.flatnonzero(model.rigid == model.rigid[hand]))
    tip = nearest(kin, body, Ball(kin.position[hand] + [0.5, 0.0, 0.0], 0.1))
    times = np.arange(0.0, 1.0, 0.01)
    balls = np.array([tip.point + (0.1 + 0.2 * (1.0 - t)) * tip.direction for t in times])
    steps = []
    for i, ball in enumerate(balls):
        near, known = nearest(kin, body, Ball(ball, 0.1)), int(i not in unknown)
        sensed = SimpleNamespace(
            link=np.full(known, hand), body_point=np.tile(near.point, (known, 1)),
            body_distance=np.full(known, near.distance + mistake),
        )  # fmt: skip
        steps.append(SimpleNamespace(stamp=times[i], q=READY, obstacles=sensed))
    pressed = np.array([[5.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    touches = [Touch(t, hand, 0.2 * tip.direction) for t in (0.995, 1.05)]
    record = Record(steps, np.array([0.995, 1.0]), pressed, touches, balls)
    return record, scene()


@pytest.mark.parametrize(("unknown", "mistaken"), [((), 0.019), ((80,), None), ((40,), 0.019)])
def test_a_touch_has_the_speed_of_the_arm_and_was_seen_in_time_if_known_all_of_the_last_0_4_s(unknown, mistaken):
    (touch,) = touches_of(*recorded(0.019, unknown))  # the second is an echo of the first
    assert touch["speed_m_s"] == pytest.approx(0.2, abs=1e-3)
    assert touch["mistaken_m"] == pytest.approx(mistaken, abs=1e-4)


def row(commander, touches=(), least=0.1, error=None, broken=0):
    moved = {"steps": 100, "limit_violations": broken, "error_m2": error, "change_m2_s2": 4.0}
    found = [{"speed_m_s": speed, "mistaken_m": mistaken} for speed, mistaken in touches]
    return {"filter": "none", "commander": commander, "touches": found, "least_distance_m": least} | moved


def test_rows_keep_what_was_not_seen_apart():
    rows = [row("at-person", [(0.04, 0.01), (0.7, None)], -0.01), row("at-person", [(0.3, 0.0), (0.1, 0.03)], broken=2)]
    at_person, tracking = groups = shield.results([*rows, row("tracking", error=1.0)])
    assert (at_person["trials"], at_person["steps"], at_person["limit_violations"]) == (2, 200, 2)
    assert (at_person["touches"], at_person["touch_speed_m_s"], at_person["over_bound"]) == (3, 0.3, 1)
    assert at_person["excess_m_s"] == pytest.approx(0.2306, abs=1e-4)
    assert (at_person["unseen_touches"], at_person["unseen_touch_speed_m_s"]) == (1, 0.7)
    assert at_person["least_distance_m"] == -0.01
    assert at_person["intervention"] == pytest.approx(0.2, abs=1e-4)
    assert at_person["task_error"] is None
    assert (tracking["task_error"], tracking["touch_speed_m_s"]) == (0.1, None)
    (table,) = shield.tables(groups)
    assert table.rows[0][:7] == ("none", "at-person", "2", "200", "2", "1/3", "0.23")


def test_the_shield_is_played_in_six_hundred_trials_and_a_quick_run_is_a_part_of_them():
    plays = [(str(cell), seed) for cell, seed in shield.plays("published", quick=False)]
    assert len(set(plays)) == len(plays)
    assert sum("pretouch" in cell for cell, _ in plays) == 600
    assert {(str(cell), seed) for cell, seed in shield.plays("published", quick=True)} < set(plays)


def test_a_trial_is_played_and_measured():
    measured = shield.trial({"filter": "pretouch", "commander": "at-person", "scene": "srdo"}, 1000)
    assert measured["touches"]
    assert measured["limit_violations"] == 0
    assert measured["change_m2_s2"] > 0.0
    json.dumps(measured, allow_nan=False)
