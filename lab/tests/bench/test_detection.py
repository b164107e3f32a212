import json
from dataclasses import asdict, replace
from functools import cache
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from pretouch.contact.detector import Detection
from pretouch.contact.reaction import reaction_velocity
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.loop import run
from pretouch.profiles import profile
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import GhostSpec, SceneSpec, fixtures
from pretouch.types import Contact, RobotState, Thresholds, no_obstacles
from pretouch_lab.bench import contacts, detection
from pretouch_lab.bench import free as free_motion
from pretouch_lab.bench.contacts import Toucher, Touching, plan
from pretouch_lab.bench.contenders import DETECTORS, Contender, ablated
from pretouch_lab.bench.detection import BUSY, matched, plays, rows_of, sweep_values, towards, trial
from pretouch_lab.bench.detection_results import delays, rate, results
from pretouch_lab.bench.detection_tables import reached, tables
from pretouch_lab.bench.free import free_stream
from pretouch_lab.bench.replays import REST, Steps, alarms_of, begun
from pretouch_lab.bench.scenes import ArmCell, model
from pretouch_lab.bench.streams import AWAY, StreamRecorder
from pretouch_lab.replay import DetectorAlone, FirstMotion, Ghost

HAND = 10
PAPER = Contender("paper", "paper", "f_base_n")
SIDE = np.array([0.0, -1.0, 0.0])


def touching(start, force=30.0, duration=0.4, rise=0.02, link=HAND):
    return Touching(link, 1, force, rise, duration, start, np.array([0.0, -0.1, 0.05]), SIDE, -SIDE, 0.05)


@cache
def touched(name):
    """Steps of a controller that is touched and yields, and the stream of what it was given."""
    scene = SceneSpec(ghost=GhostSpec(0.05, tuple(AWAY)))
    plant = Plant(model(), scene, PlantParams(), brought_to(model(), Circle().point(0.0)), 1000)
    finders = RangeFinders(plant, paper_skin(model()), RangeFinderParams(), 1000)
    Ghost(plant, Toucher(plant, [touching(2.5)]).hand)
    controller = Controller(model(), paper_skin(model()), fixtures(scene), Circle(), profile(name))
    steps = []
    recorder = StreamRecorder(plant, lambda cycle: steps.append(cycle.step))
    run(controller, plant, finders, PlantClock(plant, 0.01), recorder, lambda step: step.stamp >= 3.2)
    return steps, recorder.stream()


@pytest.mark.parametrize("baseline", [PAPER, DETECTORS[-1]], ids=lambda baseline: baseline.name)
def test_a_stream_is_what_the_controller_was_given_and_a_replay_detects_what_it_detected(baseline):
    steps, stream = touched(baseline.name)
    for i, (robot, obstacles, _, watched) in enumerate(stream.steps()):
        np.testing.assert_array_equal(robot.q, steps[i].q)
        np.testing.assert_array_equal(obstacles.point, steps[i].obstacles.point)
        assert watched or i < 10  # no unit has been heard when the arm begins
        np.testing.assert_array_equal(stream.obstacle_points(i), steps[i].obstacles.point)
    assert any(len(step.obstacles.unit) for step in steps)
    made = Steps(stream, model()).replay(baseline)
    felt = [i for i, step in enumerate(steps) if step.contact is not None]
    assert felt
    assert made.onsets() == felt
    if baseline is PAPER:
        np.testing.assert_array_equal(made.force[felt], [steps[i].contact.force for i in felt])
    else:
        armed = [i for i, step in enumerate(steps) if step.armed]
        np.testing.assert_array_equal(made.statistic[armed], [steps[i].evidence for i in armed])


@pytest.mark.parametrize(
    "name", ["blind", "paper", "paper-raw", "fixed", "observer", "pretouch", "without detect.learn"]
)
def test_alarms_of_a_whole_stream_are_those_of_its_steps_one_by_one(name):
    contender = next(one for one in (*DETECTORS, *ablated()) if one.name == name)
    _, stream = touched("blind")
    stream = replace(stream, reacting=np.zeros_like(stream.reacting))
    for i in (40, 260, 261):  # an arm in a singular posture has no estimate of the force
        stream.robot["wrench"][i] = np.nan
    alone, steps = DetectorAlone(contender.profile, model()), Steps(stream, model())
    made, alarms = alarms_of(steps, contender), 0
    for i, (robot, obstacles, _, watched, kin) in enumerate(steps.each):
        sees = contender.profile.perception is not None
        detection = alone.step(kin, robot, obstacles if sees else no_obstacles(), False, sees and watched)
        assert made.alarm[i] == (detection.contact is not None)
        np.testing.assert_allclose(made.statistic[i], contender.statistic(detection, alone.window.newest, robot.wrench))
        if made.alarm[i] and contender.profile.detect.name != "sequential":
            np.testing.assert_allclose(made.force[i], detection.contact.force, rtol=1e-12)
        alarms += made.alarm[i]
    assert alarms


def test_only_a_detector_with_a_memory_is_given_what_was_seen_before():
    _, stream = touched("paper")
    count, ages = np.zeros_like(stream.count), np.array([0.0, 0.06, 0.07, 5.0])
    count[[3, 7]] = 1, 3
    stream = replace(stream, count=count, obstacles=no_obstacles(4)._replace(age=ages))
    for name, left in (("blind", [0, 0]), ("paper", [1, 1]), ("pretouch", [1, 3])):
        near, number = stream.near(profile(name).perception)
        assert number[[3, 7]].tolist() == left
        np.testing.assert_array_equal(near.age, ages[: number.sum()])


@pytest.mark.parametrize("name", ["paper", "pretouch"])
def test_the_first_motion_of_an_answer_is_with_the_push(name):
    _, stream = touched(name)
    made = Steps(stream, model()).replay(Contender(name, name, "scale"))
    moving = np.flatnonzero(np.isfinite(made.motion).all(axis=1))
    assert len(moving) == len(made.onsets()) == 1
    kin = model().kinematics(stream.robot["q"][moving[0]])
    touch = touching(2.5)
    point = kin.position[HAND] + kin.rotation[HAND] @ touch.point
    velocity = model().jacobian(kin, HAND, point)[:3] @ made.motion[moving[0]]
    assert velocity @ (kin.rotation[HAND] @ touch.inwards) > 0.02
    assert towards((0.05, made.onsets()[0]), touch, stream, made) is False
    away = replace(made, motion=-made.motion)
    assert towards((0.05, made.onsets()[0]), touch, stream, away) is True
    assert towards((0.05, moving[0] + 1), touch, stream, made) is False, "nothing moves"
    if name == "paper":
        push = reaction_velocity(made.force[moving[0]], profile(name).react.compliance_m_s_n, 0.3)
        np.testing.assert_allclose(model().ee_jacobian(kin)[:3] @ made.motion[moving[0]], push, atol=1e-9)


def test_a_push_on_an_inner_link_that_feels_backwards_at_the_hand_moves_the_arm_with_it():
    arm, ours, rng = model(), profile("pretouch"), np.random.default_rng(1000)
    q, still = arm.description.q_ready, np.zeros(7)
    robot = RobotState(0.0, q, still, q, still, still, None)
    kin, link, backwards = arm.kinematics(robot.q), arm.link_index("panda_link2"), 0
    for _ in range(20):
        force = rng.normal(size=3)
        there = arm.jacobian(kin, link, kin.position[link] + np.array([0.0, 0.0, 0.2]))[:3]
        torque = there.T @ force
        force, torque = 8.0 * force / np.abs(torque).max(), 8.0 * torque / np.abs(torque).max()
        backwards += np.linalg.pinv(arm.ee_jacobian(kin)[:3].T) @ torque @ force < 0.0
        first = FirstMotion(arm, ours, robot.q, REST)
        for _ in range(3):
            assert first.step(kin, robot, felt(np.zeros(7)), no_obstacles()) is None
        moves = [first.step(kin, robot, felt(torque), no_obstacles()) for _ in range(50)]
        begins = [qd for qd in moves if qd is not None]
        assert len(begins) == 1
        assert force @ there @ begins[0] > 0.0
    assert backwards


def felt(torque):
    """What a detector says of joint torques (n,): a contact, where there are any."""
    contact = Contact(np.ones(3), np.ones(3, np.bool_)) if torque.any() else None
    return Detection(Thresholds(*np.zeros((6, 3))), contact, True, torque, 2.0 if torque.any() else 0.0)


def test_the_sweep_of_one_replay_is_what_each_value_would_find_itself():
    _, stream = touched("paper")
    for text in ("paper", "paper:detect.compare=raw", "blind"):
        made = Steps(stream, model()).replay(Contender(text, text, "f_base_n"))
        assert made.onsets() == made.onsets(10.0)
        for value in (6.0, 14.0):
            own = Contender("own", f"{text}:detect.f_base_n={value}", "f_base_n")
            assert made.onsets(value) == Steps(stream, model()).replay(own).onsets()


def test_an_alarm_is_answered_before_another_one_counts():
    alarm = np.zeros(3 * REST, np.bool_)
    alarm[[5, 6, 4 + REST, 5 + REST, 6 + REST, 8 + 2 * REST]] = True
    assert begun(alarm) == [5, 5 + REST, 8 + 2 * REST]
    assert begun(np.zeros(4, np.bool_)) == []


def test_alarms_are_matched_with_the_contacts_that_caused_them():
    stamp = np.arange(0.0, 20.0, 0.01)
    touches = [touching(5.0, force=20.0, rise=0.02, duration=0.1), touching(8.0), touching(12.0), touching(16.0)]

    def step(time):
        return int(np.searchsorted(stamp, time - 1e-9))

    # felt after 49 ms; missed, the alarm comes 0.31 s after its end; a false alarm 1.5 s before; felt at the very end
    onsets = [step(5.05), step(8.72), step(10.6), step(16.69)]
    found = matched(touches, stamp, onsets)
    assert found[0] == (pytest.approx(0.049), onsets[0])
    assert found[1] == (None, None)
    assert found[2] == (BUSY, None)
    assert found[3] == (pytest.approx(0.69 - 0.02 / 30), onsets[3])
    # before a force passes one newton it is no detection
    slow = touching(3.0, force=10.0, rise=0.5, duration=1.2)
    assert slow.onset(1.0) == pytest.approx(3.05)
    assert matched([slow], stamp, [304]) == [(BUSY, None)]
    assert matched([slow], stamp, [306]) == [(pytest.approx(0.01), 306)]


@pytest.mark.parametrize("link", [3, HAND])
def test_the_force_laid_on_is_the_force_mujoco_feels(link):
    plant = Plant(model(), SceneSpec(), PlantParams(), model().description.q_ready, 1000)
    touch = replace(touching(0.0, rise=0.001, link=link), point=np.array([0.03, -0.05, 0.04]))
    Toucher(plant, [touch])
    plant.advance(0.01)
    data = plant.mj_data
    rotation, origin = plant.link_rotation[link].copy(), plant.link_position[link].copy()
    point, force = origin + rotation @ touch.point, 30.0 * (rotation @ touch.inwards)
    expected, felt = np.zeros((2, plant.mj_model.nv))
    mujoco.mj_applyFT(plant.mj_model, data, force, np.zeros(3), point, link, expected)
    wrench = data.xfrc_applied[link]
    mujoco.mj_applyFT(plant.mj_model, data, wrench[:3], wrench[3:], data.xipos[link], link, felt)
    np.testing.assert_allclose(felt, expected, atol=0.05)
    assert not np.delete(data.xfrc_applied, link, axis=0).any()
    plant.advance(0.5)
    assert not data.xfrc_applied.any()


def test_a_force_rises_holds_and_falls_and_the_hand_comes_rests_on_the_point_and_withdraws():
    touch = touching(1.0, force=10.0, rise=0.1, duration=0.5)
    sizes = [touch.size_n(time) for time in (0.9, 1.0, 1.05, 1.1, 1.3, 1.45, 1.5, 2.0)]
    assert sizes == pytest.approx([0.0, 0.0, 5.0, 10.0, 10.0, 5.0, 0.0, 0.0])
    plant = Plant(model(), SceneSpec(), PlantParams(), model().description.q_ready, 1000)
    toucher = Toucher(plant, [touching(2.0, duration=0.4)])
    surface = plant.link_position[HAND] + plant.link_rotation[HAND] @ touching(2.0).point
    away = [np.linalg.norm(toucher.hand(time) - surface) - 0.05 for time in (1.0, 1.5, 2.0, 2.3, 2.9)]
    assert away == pytest.approx([0.3, 0.15, 0.0, 0.0, 0.15])
    np.testing.assert_array_equal(toucher.hand(0.5), AWAY)
    np.testing.assert_array_equal(toucher.hand(9.0), AWAY)


def test_planned_contacts_leave_time_for_a_reaction_and_lie_on_the_surface():
    touches = plan(12, 0.05, 1000)
    assert [t.start for t in touches] == [t.start for t in plan(12, 0.05, 1000)]
    assert all(b.start - a.end >= 2.6 for a, b in pairwise(touches))
    for touch in touches:
        own = model().capsules.of_links(np.array([touch.link]))
        axis, rel = own.b - own.a, touch.point - own.a
        part = np.clip((rel * axis).sum(axis=1) / (axis**2).sum(axis=1), 0, 1)
        gap = np.linalg.norm(rel - part[:, None] * axis, axis=1) - own.radius
        assert gap.min() == pytest.approx(0.0, abs=0.0021)
        assert touch.inwards @ touch.normal < -0.8


def test_a_quick_run_is_a_part_of_the_full_one():
    names = ("family", "kind", "sensing", "path", "speed_m_s", "near")
    quick, full = (
        {(*(arm[name] for name in names), seed): arm["ablated"] for arm, seed in plays("development", which)}
        for which in (True, False)
    )
    assert len({(family, seed) for family, *_, seed in full}) == len(full) == 60 + 35 + 72 + 18
    assert quick.items() < full.items()
    assert sum(full.values()) == 2 * 5 + 8
    assert {arm["family"] for arm, _ in plays("development", True, "stress")} == {"free", "contacts"}


def test_a_rate_has_the_bounds_of_a_poisson_count_and_delays_are_of_what_was_detected():
    # chi-squared quantiles by hand: four in two hours are 0.545 to 5.12 an hour
    some = rate([2, 2], 2.0)
    assert (some["low_per_hour"], some["high_per_hour"]) == pytest.approx((0.545, 5.121), abs=0.001)
    assert some["false_alarms_per_hour"] == 2.0
    assert delays([0.02, None, 0.04, BUSY, 0.03]) == {
        "median_delay_s": 0.03, "p95_delay_s": 0.039, "missed": 1,
        "contacts": 4, "busy": 1
    }  # fmt: skip
    assert delays([None])["median_delay_s"] is None


def test_every_baseline_is_a_profile_with_its_own_value_on_its_curve():
    every = (*DETECTORS, *ablated())
    assert len({baseline.name for baseline in every}) == len(every)
    for baseline in every:
        own = baseline.profile.detect.f_base_n if baseline.sweep == "f_base_n" else 1.0
        assert own in sweep_values(baseline)


def test_a_run_leaves_rows_for_every_detector(monkeypatch):
    for module in (detection, free_motion):
        monkeypatch.setattr(module, "warm_up_s", lambda: 1.5)
    monkeypatch.setattr(contacts, "plan", lambda *_: [touching(1.8)])
    free = ArmCell("free", sensing="seven", speed_m_s=0.3, near="standing", counted_s=1.0, ablated=True)
    pushed = ArmCell("contacts", sensing="seven", speed_m_s=0.3, near="touched", count=1)
    rows = rows_of([cell | trial(cell, 1000) for cell in (asdict(pushed), asdict(free))])
    assert [row["family"] for row in rows[:2]] == ["free", "free"]
    assert len(rows) == 2 * len(DETECTORS) + len(ablated())  # the contacts are not those that ablations are given
    contact = next(row for row in rows if row["family"] == "contacts")["contacts"][0]
    assert contact["delay_s"] < 0.2
    assert contact["towards"] is False
    assert contact["detectable"]
    found = json.loads(json.dumps(results(rows), allow_nan=False))
    assert "Contact detection: the goals" in [table.title for table in tables(found)]
    assert found["resolution"].startswith(
        "0.00028 h of free motion. No false alarm in the 0.00028 h at the goal's speed means fewer than"
    )
    assert results([])["resolution"].endswith("no rate of false alarms.")


def test_arms_that_nobody_is_near_move_alike_without_units(monkeypatch):
    free = ArmCell("free", sensing="seven", speed_m_s=0.3, counted_s=1.0)
    monkeypatch.setattr(free_motion, "warm_up_s", lambda: 0.0)
    made = free_stream(free, 1000)
    monkeypatch.setattr(free_motion, "_bystander", lambda *_: lambda _: AWAY)
    seen = free_stream(replace(free, near="standing"), 1000)
    assert not seen.count.any()
    np.testing.assert_array_equal(made.watched, seen.watched)
    for name, numbers in made.robot.items():
        np.testing.assert_array_equal(numbers, seen.robot[name])


def test_a_goal_is_reached_or_not():
    row = {"false_alarms_per_hour": 1.0, "contacts": 9, "missed": 0, "median_delay_s": 0.025, "towards": 0}
    for change, expected in (
        ({}, "rate\nseen\nunseen\ndirection"),
        ({"false_alarms_per_hour": 1.01}, "seen\nunseen\ndirection"),
        ({"missed": 1}, "rate\ndirection"),
        ({"median_delay_s": 0.026}, "rate\nunseen\ndirection"),
        ({"towards": 1, "median_delay_s": 0.033, "false_alarms_per_hour": 2.0}, "none"),
    ):
        own = row | change
        assert reached(own, own, own) == expected
