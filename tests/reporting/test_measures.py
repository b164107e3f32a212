from dataclasses import replace

import numpy as np
import pytest

from pretouch.modes import Event
from pretouch.profiles import profile
from pretouch.reporting.health import loop_health, unit_health
from pretouch.reporting.limits import limit_margins, states, violations
from pretouch.reporting.motion import distances, speeds
from pretouch.reporting.record import gather, least, spread
from pretouch.robot.description import fr3
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.types import Mode, QpOutcome, QpSolution, RangeReadings, RangeStatus
from tests.reporting import made

READ = RangeStatus.OK, RangeStatus.SIGNAL, RangeStatus.OK


def course_of(model, skin, steps, **more):
    return gather(made.recorded(model, skin, steps, **more))


def test_small_measures_leave_out_what_is_no_number():
    assert spread(np.array([np.nan, np.inf])) is None
    assert spread(np.array([1.0, np.nan, 3.0, 2.0])).median == 2.0
    assert least(np.array([np.nan, 2.0, 1.0, np.nan])) == (1.0, 2)
    assert least(np.full(3, np.nan)) is None


@pytest.mark.parametrize(("stamps", "lasted"), [((0.0, 1.0, 1.5, 2.5), (1.0, 0.5, 1.0, 1.0)), ((5.0,), (0.0,))])
def test_a_step_lasts_until_the_next_and_the_last_as_long_as_is_usual(panda_model, paper_skin, stamps, lasted):
    course = course_of(panda_model, paper_skin, [made.step(panda_model, stamp=stamp) for stamp in stamps])
    assert tuple(course.lasted) == lasted


def test_distances_are_least_by_unit_by_link_and_in_time(panda_model, paper_skin):
    near = [
        [(0, "panda_hand", 0.5, 0.7), (5, "panda_link4", 0.3, 0.9)],
        [(0, "panda_hand", 0.09, 0.4), (5, "panda_link4", 0.7, 0.9)],
        [],
        [(0, "panda_link7", 0.2, 0.5)],
    ]
    steps = [made.step(panda_model, stamp=0.01 * i, near=points) for i, points in enumerate(near)]
    found = distances(course_of(panda_model, paper_skin, steps))
    assert (found.body.name, found.body.distance, found.body.time) == ("hand_left", 0.09, 0.01)
    assert (found.ee.distance, found.ee.time) == (0.4, 0.01)
    assert [u.distance if u else None for u in found.units] == [0.09, None, None, None, None, 0.3, None]
    assert [(n.name, n.distance) for n in found.links] == [
        ("panda_hand", 0.09), ("panda_link7", 0.2), ("panda_link4", 0.3)
    ]  # fmt: skip
    assert found.below_crit_s == pytest.approx(0.01)
    assert found.below_notice_s == pytest.approx(0.03)
    assert found.within_d_max_s == pytest.approx(0.03)


def test_what_outside_sources_saw_counts_for_the_body_and_for_no_unit(panda_model, paper_skin):
    near = [[(0, "panda_hand", 0.5, 0.7), (9, "panda_link4", 0.05, 0.2)], [(22, "panda_link4", 0.06, 0.3)]]
    steps = [made.step(panda_model, stamp=0.01 * i, near=points) for i, points in enumerate(near)]
    found = distances(course_of(panda_model, paper_skin, steps))
    assert (found.body.name, found.body.distance) == ("hand_left", 0.5)
    assert (found.ee.distance, found.links[0].name, found.links[0].distance) == (0.2, "panda_link4", 0.05)
    assert found.below_crit_s == pytest.approx(0.02)


def test_the_nearest_of_several_points_counts_in_whatever_order(panda_model, paper_skin):
    near = [(0, "panda_hand", 0.5, 0.3), (1, "panda_hand", 0.4, 0.2), (2, "panda_hand", 0.6, np.nan)]
    course = course_of(panda_model, paper_skin, [made.step(panda_model, near=near)])
    assert list(course.ee_distance) == [0.2]
    assert course.link_distance[0, panda_model.link_index("panda_hand")] == 0.4


def test_speeds_are_told_by_mode_and_by_what_is_near(panda_model, paper_skin):
    def moving(i, speed, near=(), mode=Mode.TRACK, scale=1.0):
        velocity = np.array([0.0, speed, 0.0])
        return made.step(
            panda_model, stamp=0.01 * i, near=near, ee_velocity=velocity, mode=mode, speed_scale=scale
        )  # fmt: skip

    steps = [
        moving(0, 0.3),
        moving(1, 0.1, [(0, "panda_hand", 0.2, 0.5)], scale=0.4),
        moving(2, 0.2, mode=Mode.REACT, scale=0.1),
        moving(3, 0.2, [(0, "panda_hand", 1.0, 1.2)]),
    ]
    found = speeds(course_of(panda_model, paper_skin, steps))
    assert found.all.max == 0.3
    assert found.near.max == 0.1
    assert found.free.median == 0.25
    assert found.by_mode[Mode.REACT].median == 0.2
    assert found.by_mode[Mode.HOLD] is None
    assert (found.least_factor, found.median_factor) == (0.4, 1.0)
    assert found.slowed == pytest.approx(1 / 3)


def commanded(model, *commands, stamps=None):
    stamps = stamps or [0.01 * i for i in range(len(commands))]
    return [made.step(model, stamp=t, command=np.array(c)) for t, c in zip(stamps, commands, strict=True)]


def test_commands_are_fractions_of_the_limits(panda_model, paper_skin):
    zero, first = np.zeros(7), np.eye(7)[0]
    steps = commanded(panda_model, zero, 0.15 * first, 0.075 * first)  # 15 rad/s^2 is the limit of joint 1
    joint = limit_margins(course_of(panda_model, paper_skin, steps))[0]
    assert joint.acceleration.max == pytest.approx(1.0)
    assert joint.speed.max == pytest.approx(0.15 / 2.175)
    assert joint.margin == pytest.approx(panda_model.q_max[0])
    assert joint.violations == ()


def test_a_step_that_came_late_had_longer_to_accelerate(panda_model, paper_skin):
    steps = commanded(panda_model, np.zeros(7), 0.3 * np.eye(7)[0], stamps=[0.0, 0.02])
    joint = limit_margins(course_of(panda_model, paper_skin, steps))[0]
    assert joint.acceleration.max == pytest.approx(1.0)


def test_exceeded_limits_are_named(panda_model, paper_skin):
    beyond = panda_model.description.q_ready.copy()
    beyond[3] = panda_model.q_max[3] + 0.1
    steps = commanded(panda_model, np.zeros(7), 3.0 * np.eye(7)[1])
    steps[1] = replace(steps[1], q=beyond)
    joints = limit_margins(course_of(panda_model, paper_skin, steps))
    assert violations(joints) == ["velocity of joint 2", "acceleration of joint 2", "position of joint 4"]
    assert joints[3].margin_measured == pytest.approx(-0.1)


def test_an_envelope_allows_less_towards_the_end_of_a_range():
    model = RobotModel(fr3())
    q = model.description.q_ready.copy()
    envelope = model.description.envelope
    q[0] = envelope.q_upper[0] - 0.1
    allowed = np.sqrt(envelope.slope[0] * 0.1) - envelope.offset[0]
    outwards, inwards = allowed * np.eye(7)[0], -2.62 * np.eye(7)[0]
    for command in (outwards, inwards):
        steps = [made.step(model, q_commanded=q, command=command)]
        joint = limit_margins(course_of(model, paper_skin(model), steps))[0]
        assert joint.speed.max == pytest.approx(1.0)


def test_holds_are_told_by_their_event_not_by_their_sentence(panda_model, paper_skin):
    said = ["Filling (1 of 100).", "Filling (2 of 100).", "Silent: a.", "Following.", "Silent: a."]
    modes = [Mode.HOLD, Mode.HOLD, Mode.HOLD, Mode.TRACK, Mode.HOLD]
    events = [Event.WINDOW_FILLING, Event.WINDOW_FILLING, Event.SKIN_SILENT, Event.CLEAR, Event.SKIN_SILENT]
    steps = [
        made.step(panda_model, stamp=0.01 * i, mode=mode, event=event, reason=reason)
        for i, (mode, event, reason) in enumerate(zip(modes, events, said, strict=True))
    ]
    found = states(course_of(panda_model, paper_skin, steps))
    assert [(h.sentence, round(h.start, 2), round(h.duration, 2)) for h in found.holds] == [
        (said[0], 0.0, 0.02), (said[2], 0.02, 0.01), (said[4], 0.04, 0.01)
    ]  # fmt: skip
    assert found.share[Mode.HOLD] == pytest.approx(0.8)


def test_outcomes_and_slack_are_counted(panda_model, paper_skin):
    def solved(outcome, slack):
        qp = QpSolution(np.zeros(7), np.array(slack), np.zeros(7 + len(slack)), outcome, "")
        return made.step(panda_model, qp=qp, restricted=np.arange(len(slack)), approach_limit=np.zeros(len(slack)))

    steps = [solved(QpOutcome.SOLVED, [0.1, 0.2]), solved(QpOutcome.INFEASIBLE, [0.0]), solved(QpOutcome.SOLVED, [])]
    found = states(course_of(panda_model, paper_skin, steps))
    assert found.outcomes[QpOutcome.SOLVED] == 2
    assert found.outcomes[QpOutcome.INFEASIBLE] == 1
    assert (found.slack.median, found.slack.max) == (0.1, 0.2)


def readings(model, stamps, statuses=None, lengths=None):
    """Steps at 100 Hz whose one unit has measured at the stamps, each reading given 15 ms later or at the next step."""
    given, steps = [], []
    for i in range(int(stamps[-1] * 100) + 4):
        now = 0.01 * i
        heard = [k for k, stamp in enumerate(stamps) if stamp + 0.015 <= now + 1e-9]
        k = heard[-1] if heard else None
        reading = RangeReadings(
            np.array([-np.inf if k is None else stamps[k]]),
            np.array([0.5 if k is None or lengths is None else lengths[k]]),
            np.array([RangeStatus.NONE if k is None else (statuses or READ * 999)[k]], dtype=np.int64),
        )
        given.append(made.inputs(model, 1, stamp=now, readings=reading))
        steps.append(made.step(model, units=1, stamp=now))
    return steps, given


@pytest.fixture
def one_unit(panda_model, paper_skin):
    return Skin(paper_skin.units[:1], panda_model)


def test_rate_loss_latency_and_status_of_a_unit(panda_model, one_unit):
    stamps = [0.02 * k for k in range(50) if k not in (10, 11)]  # 50 Hz, two lost
    steps, given = readings(panda_model, stamps)
    (unit,) = unit_health(course_of(panda_model, one_unit, steps, given=given))
    assert unit.readings == 48
    assert unit.rate == pytest.approx(50.0)
    assert unit.lost == pytest.approx(2 / 49)
    assert unit.latency.median == pytest.approx(0.02)
    assert unit.silence == pytest.approx(0.06)
    assert unit.status == {"OK": 32, "SIGNAL": 16}


def test_noise_leaves_a_steady_motion_out(panda_model, one_unit):
    rng = np.random.default_rng(5)
    stamps = 0.02 * np.arange(2000)
    lengths = 1.0 + 0.01 * stamps + 0.004 * rng.standard_normal(2000)
    steps, given = readings(panda_model, list(stamps), statuses=[0] * 2000, lengths=lengths)
    (unit,) = unit_health(course_of(panda_model, one_unit, steps, given=given))
    assert unit.noise == pytest.approx(0.004, rel=0.08)


def test_a_unit_never_heard_is_silent_all_the_time(panda_model, one_unit):
    steps = [made.step(panda_model, units=1, stamp=0.01 * i) for i in range(101)]
    never = RangeReadings(np.array([-np.inf]), np.array([np.nan]), np.array([RangeStatus.NONE], dtype=np.int64))
    given = [made.inputs(panda_model, 1, stamp=s.stamp, readings=never) for s in steps]
    (unit,) = unit_health(course_of(panda_model, one_unit, steps, given=given))
    assert (unit.readings, unit.rate, unit.latency, unit.noise) == (0, None, None, None)
    assert unit.silence == pytest.approx(1.0)


def test_robot_and_loop(panda_model, paper_skin):
    stamps = [0.0, 0.01, 0.02, 0.05, 0.06]
    steps = [made.step(panda_model, stamp=t) for t in stamps]
    given = [made.inputs(panda_model, stamp=t, age=0.002) for t in stamps]
    given[1] = replace(given[1], robot=replace(given[1].robot, wrench=None))
    given[4] = None
    course = course_of(panda_model, paper_skin, steps, given=given)
    loop = loop_health(course)
    assert loop.force_missing == 0.25
    assert loop.age.max == pytest.approx(0.002)
    assert loop.rate == pytest.approx(3 / 0.05)
    assert (loop.late, loop.without_inputs) == (1, 1)
    assert loop.period.max == pytest.approx(0.03)


def test_each_step_has_the_parameters_of_its_run(panda_model, paper_skin):
    runs = tuple(made.Run(panda_model, paper_skin, profile(name)) for name in ("paper", "paper-0.5m"))
    near = [(0, "panda_hand", 0.55, 0.7)]
    kept = [made.Kept(i // 10, None, made.step(panda_model, stamp=0.01 * i, near=near)) for i in range(20)]
    found = distances(gather(made.Recorded(runs, kept)))
    assert found.below_notice_s == pytest.approx(0.1)
    assert found.within_d_max_s == pytest.approx(0.1)
