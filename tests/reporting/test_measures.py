import re
from dataclasses import replace

import numpy as np
import pytest

from pretouch.modes import Event
from pretouch.profiles import profile
from pretouch.reporting.health import loop_row, unit_row
from pretouch.reporting.html import bad, number
from pretouch.reporting.measures import (
    distance_section,
    holds_in,
    limit_rows,
    mode_section,
    nearest_to_body,
    speed_section,
    time_in_modes,
)
from pretouch.reporting.record import gather, least, spread
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.types import Mode, QpOutcome, QpSolution, RangeReadings, RangeStatus
from tests.reporting import made

READ = RangeStatus.OK, RangeStatus.SIGNAL, RangeStatus.OK


def course_of(model, skin, steps, **more):
    return gather(made.recorded(model, skin, steps, **more))


def cells(section):
    """The cells of each line of the tables of a section, as text."""
    lines = re.findall(r"<tr>(.*?)</tr>", section)
    return [re.findall(r"<t[dh][^>]*>(?:<span[^>]*>)?(.*?)(?:</span>)?</t[dh]>", line) for line in lines]


def test_small_measures_leave_out_what_is_no_number():
    assert np.isnan(spread(np.array([np.nan, np.inf]))).all()
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
    course = course_of(panda_model, paper_skin, steps)
    assert nearest_to_body(course) == ("hand_left", 0.09, 0.01)
    facts, units, links = cells(distance_section(course))[:5], cells(distance_section(course))[6:13], 14
    assert facts == [
        ["nearest to the body", "0.090 m, shown by hand_left at 0.01 s"],
        ["nearest to the end-effector&#x27;s origin", "0.400 m at 0.01 s"],
        ["body nearer than d_crit", "0.01 s"],
        ["body nearer than d_notice", "0.03 s"],
        ["end-effector&#x27;s origin nearer than d_max", "0.03 s"],
    ]
    assert [unit[1] for unit in units] == ["0.090", "–", "–", "–", "–", "0.300", "–"]
    assert cells(distance_section(course))[links:] == [
        ["panda_hand", "0.090", "0.01"], ["panda_link7", "0.200", "0.03"], ["panda_link4", "0.300", "0.00"]
    ]  # fmt: skip


def test_what_outside_sources_saw_counts_for_the_body_and_for_no_unit(panda_model, paper_skin):
    near = [[(0, "panda_hand", 0.5, 0.7), (9, "panda_link4", 0.05, 0.2)], [(22, "panda_link4", 0.06, 0.3)]]
    steps = [made.step(panda_model, stamp=0.01 * i, near=points) for i, points in enumerate(near)]
    course = course_of(panda_model, paper_skin, steps)
    assert nearest_to_body(course)[:2] == ("hand_left", 0.5)
    lines = cells(distance_section(course))
    assert lines[1][1] == "0.200 m at 0.00 s"
    assert lines[2] == ["body nearer than d_crit", "0.02 s"]
    assert lines[14] == ["panda_link4", "0.050", "0.00"]


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
    section = speed_section(course_of(panda_model, paper_skin, steps))
    rows = {name: values for name, *values in cells(section)}
    assert rows["whole recording"][2] == "0.300"
    assert rows["anything within d_max"][2] == "0.100"
    assert rows["TRACK, nothing within d_max"][0] == "0.250"
    assert rows["REACT"][0] == "0.200"
    assert rows["HOLD"] == ["–"] * 3
    assert "had the median 1.00 and the least value 0.40; it was below 0.99 for 33 % of the steps" in section


def commanded(model, *commands, stamps=None):
    stamps = stamps or [0.01 * i for i in range(len(commands))]
    return [made.step(model, stamp=t, command=np.array(c)) for t, c in zip(stamps, commands, strict=True)]


def test_commands_are_fractions_of_the_limits(panda_model, paper_skin):
    zero, first = np.zeros(7), np.eye(7)[0]
    steps = commanded(panda_model, zero, 0.15 * first, 0.075 * first)  # 15 rad/s^2 is the limit of joint 1
    rows, exceeded = limit_rows(course_of(panda_model, paper_skin, steps))
    assert exceeded == []
    margin = number(panda_model.q_max[0], 3)
    assert list(rows[0].values())[:5] == ["1", margin, margin, "6.9 %", "6.8 %"]
    assert rows[0]["acceleration, largest"] == "100.0 %"


def test_a_step_that_came_late_had_longer_to_accelerate(panda_model, paper_skin):
    steps = commanded(panda_model, np.zeros(7), 0.3 * np.eye(7)[0], stamps=[0.0, 0.02])
    rows, exceeded = limit_rows(course_of(panda_model, paper_skin, steps))
    assert (rows[0]["acceleration, largest"], exceeded) == ("100.0 %", [])


def test_exceeded_limits_are_named(panda_model, paper_skin):
    beyond = panda_model.description.q_ready.copy()
    beyond[3] = panda_model.q_max[3] + 0.1
    steps = commanded(panda_model, np.zeros(7), 3.0 * np.eye(7)[1])
    steps[1] = replace(steps[1], q=beyond)
    rows, exceeded = limit_rows(course_of(panda_model, paper_skin, steps))
    assert exceeded == ["velocity of joint 2", "acceleration of joint 2", "position of joint 4"]
    assert rows[3]["measured [rad]"] == bad("−0.100")
    assert rows[1]["acceleration, largest"] == bad("4000.0 %")


def test_an_envelope_allows_less_towards_the_end_of_a_range(fr3_model):
    q, envelope = fr3_model.description.q_ready.copy(), fr3_model.description.envelope
    q[0] = envelope.q_upper[0] - 0.1
    allowed = np.sqrt(envelope.slope[0] * 0.1) - envelope.offset[0]
    outwards, inwards = allowed * np.eye(7)[0], -2.62 * np.eye(7)[0]
    for command in (outwards, inwards):
        steps = [made.step(fr3_model, q_commanded=q, command=command)]
        rows, exceeded = limit_rows(course_of(fr3_model, paper_skin(fr3_model), steps))
        assert (rows[0]["velocity, largest"], exceeded) == ("100.0 %", [])


def test_holds_are_told_by_their_event_not_by_their_sentence(panda_model, paper_skin):
    said = ["Filling (1 of 100).", "Filling (2 of 100).", "Silent: a.", "Following.", "Silent: a."]
    modes = [Mode.HOLD, Mode.HOLD, Mode.HOLD, Mode.TRACK, Mode.HOLD]
    events = [Event.WINDOW_FILLING, Event.WINDOW_FILLING, Event.SKIN_SILENT, Event.CLEAR, Event.SKIN_SILENT]
    steps = [
        made.step(panda_model, stamp=0.01 * i, mode=mode, event=event, reason=reason)
        for i, (mode, event, reason) in enumerate(zip(modes, events, said, strict=True))
    ]
    course = course_of(panda_model, paper_skin, steps)
    assert [(h.sentence, round(h.start, 2), round(h.duration, 2)) for h in holds_in(course)] == [
        (said[0], 0.0, 0.02), (said[2], 0.02, 0.01), (said[4], 0.04, 0.01)
    ]  # fmt: skip
    assert time_in_modes(course)[Mode.HOLD] == pytest.approx((0.04, 0.8))


def test_outcomes_and_slack_are_counted(panda_model, paper_skin):
    def solved(outcome, slack):
        qp = QpSolution(np.zeros(7), np.array(slack), np.zeros(7 + len(slack)), outcome, "")
        return made.step(panda_model, qp=qp, restricted=np.arange(len(slack)), approach_limit=np.zeros(len(slack)))

    steps = [solved(QpOutcome.SOLVED, [0.1, 0.2]), solved(QpOutcome.INFEASIBLE, [0.0]), solved(QpOutcome.SOLVED, [])]
    section = mode_section(course_of(panda_model, paper_skin, steps))
    assert {"solved": "2", "infeasible": "1"}.items() <= dict(line for line in cells(section) if len(line) == 2).items()
    assert "had the median 0.100, 99 % 0.198 and largest value 0.200 m/s" in section


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
    assert unit_row(course_of(panda_model, one_unit, steps, given=given), 0) == {
        "unit": "hand_left", "readings": "48", "rate [Hz]": "50.0", "lost": "4.1 %", "latency, median [ms]": "20.0",
        "99 % [ms]": "20.0", "longest silence [s]": "0.06", "noise [mm]": "–", "status": "OK 32, SIGNAL 16",
    }  # fmt: skip


def test_noise_leaves_a_steady_motion_out(panda_model, one_unit):
    rng = np.random.default_rng(5)
    stamps = 0.02 * np.arange(2000)
    lengths = 1.0 + 0.01 * stamps + 0.004 * rng.standard_normal(2000)
    steps, given = readings(panda_model, list(stamps), statuses=[0] * 2000, lengths=lengths)
    unit = unit_row(course_of(panda_model, one_unit, steps, given=given), 0)
    assert float(unit["noise [mm]"]) == pytest.approx(4.0, rel=0.08)


def test_a_unit_never_heard_is_silent_all_the_time(panda_model, one_unit):
    steps = [made.step(panda_model, units=1, stamp=0.01 * i) for i in range(101)]
    never = RangeReadings(np.array([-np.inf]), np.array([np.nan]), np.array([RangeStatus.NONE], dtype=np.int64))
    given = [made.inputs(panda_model, 1, stamp=s.stamp, readings=never) for s in steps]
    unit = unit_row(course_of(panda_model, one_unit, steps, given=given), 0)
    assert list(unit.values()) == ["hand_left", "0", "–", "–", "–", "–", "1.00", "–", "–"]


def test_robot_and_loop(panda_model, paper_skin):
    stamps = [0.0, 0.01, 0.02, 0.05, 0.06]
    steps = [made.step(panda_model, stamp=t) for t in stamps]
    given = [made.inputs(panda_model, stamp=t, age=0.002) for t in stamps]
    given[1] = replace(given[1], robot=replace(given[1].robot, wrench=None))
    given[4] = None
    course = course_of(panda_model, paper_skin, steps, given=given)
    loop = loop_row(course)
    assert loop["force estimate missing"] == "25.0 %"
    assert loop["robot states"] == "60.0 Hz; age median 2.0, 99 % 2.0, largest 2.0 ms"
    assert loop["late steps (by half a period or more)"] == "1"
    assert loop["steps whose inputs could not be kept"] == bad("1")
    assert loop["period of the loop"].endswith("largest 30.0 ms")


def test_each_step_has_the_parameters_of_its_run(panda_model, paper_skin):
    runs = tuple(made.Run(panda_model, paper_skin, profile(name)) for name in ("paper", "paper-0.5m"))
    near = [(0, "panda_hand", 0.55, 0.7)]
    kept = [made.Kept(i // 10, None, made.step(panda_model, stamp=0.01 * i, near=near)) for i in range(20)]
    lines = cells(distance_section(gather(made.Recorded(runs, kept))))
    assert [line[1] for line in lines[3:5]] == ["0.10 s", "0.10 s"]
