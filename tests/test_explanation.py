"""Sentences of steps made by hand, each with the numbers that it must say."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.explanation import Doing, Explanation, Limit, Limited, explain, finds, still
from pretouch.modes import TABLE, Event, Transition
from pretouch.robot.model import RobotModel
from pretouch.types import (
    Contact,
    ControlStep,
    Mode,
    Obstacles,
    QpOutcome,
    QpSolution,
    Thresholds,
    Touched,
    no_obstacles,
)
from tests.reporting import made

UNITS, LINKS = ("hand_front", "hand_left"), ("link0", "link5", "hand")
AHEAD = np.array([0.3, 0.0, 0.0])


def seen(*rows: tuple[int, float, float, int], age: float = 0.0) -> Obstacles:
    """Obstacles of (unit, distance from the end-effector, from the body [m], link), seen so long ago [s]."""
    unit, ee, body, link = (np.array(column) for column in zip(*rows, strict=True)) if rows else (np.zeros(0),) * 4
    near = no_obstacles(len(rows))
    unit, link, ages = unit.astype(int), link.astype(int), np.full(len(rows), age)
    return near._replace(unit=unit, ee_distance=ee, link=link, body_distance=body, age=ages)


def limited(slack: float = 0.0, multiplier: float = 1.0) -> QpSolution:
    """An answer that one approach row limits."""
    return QpSolution(np.zeros(7), np.array([slack]), np.r_[np.zeros(7), multiplier], QpOutcome.SOLVED, "solved")


@pytest.fixture
def step(panda_model: RobotModel) -> ControlStep:
    """Of an arm that follows its path at 0.3 m/s with nothing near."""
    parts, place = np.zeros((6, 3)), np.array([0.5, 0.25, 0.25])
    parts[0], parts[1], parts[2] = 11.0, -9.0, 1.0
    free = QpSolution(np.full(7, 0.2), np.zeros(0), np.zeros(7), QpOutcome.SOLVED, "solved")
    return made.step(
        panda_model, 2, 4.0, ee_position=place, path_position=place, ee_velocity=AHEAD, desired_velocity=AHEAD,
        thresholds=Thresholds(*parts), qp=free, command=free.qd, evidence=0.1,
    )  # fmt: skip


def said(step: ControlStep, **changes: object) -> Explanation:
    return explain(replace(step, **changes), UNITS, LINKS)  # type: ignore[arg-type]


def test_an_arm_that_nothing_limits_says_its_speed_or_place_and_what_it_sees(step: ControlStep) -> None:
    assert said(step) == Explanation(Doing.MOVING, "Moving at 0.30 m/s: nothing near is seen.")
    far = said(step, obstacles=seen((0, 0.9, 0.75, 2), (1, 0.6, 0.45, 2)))
    assert far == Explanation(Doing.MOVING, "Moving at 0.30 m/s: hand_left sees something at 0.45 m.")
    seen_too = {"obstacles": seen((1, 0.5, 0.15, 1)), "restricted": np.array([0]), "approach_limit": np.array([0.4])}
    loose = said(step, **seen_too, qp=limited(multiplier=0.0))
    assert loose.sentence == "Moving at 0.30 m/s: hand_left sees something at 0.15 m."
    rest = replace(step, desired_velocity=np.zeros(3), ee_velocity=np.zeros(3))
    assert said(rest) == Explanation(Doing.MOVING, "In position: nothing near is seen.")
    assert explain(step, (), LINKS).sentence == "Moving at 0.30 m/s: no sensor unit is in use."
    assert explain(rest, (), LINKS).sentence == "In position: no sensor unit is in use."


def test_an_arm_too_loud_for_a_light_push_says_what_it_finds(step: ControlStep) -> None:
    assert finds(step) == ""
    assert finds(replace(step, detectable_n=14.9)) == "detects pushes of 15 N or more"
    assert finds(replace(step, detectable_n=28.4)) == "now detects only pushes of 28 N or more"
    assert finds(replace(step, detectable_n=np.inf)) == "now detects no push"


def test_eq_3_is_said_with_its_factor_and_the_unit_nearest_to_the_end_effector(step: ControlStep) -> None:
    # 0.136 m of 0.8 m are 17 %; what hand_left sees is nearer to the body, but not to the end-effector
    slowed = {"speed_scale": 0.17, "desired_velocity": 0.17 * AHEAD, "ee_velocity": 0.17 * AHEAD}
    found = said(step, obstacles=seen((1, 0.5, 0.1, 1), (0, 0.136, 0.18, 2)), **slowed)
    assert found == Explanation(Doing.SLOWED, "Slowed to 17 %: hand_front sees something at 0.18 m.")
    gone = said(step, **slowed)
    why = "an obstacle is out of view, or a unit or an outside source is late"
    assert gone == Explanation(Doing.SLOWED, f"Slowed to 17 %: {why}.")
    outside = said(step, obstacles=seen((2, 0.4, 0.3, 2)), speed_scale=0.5)
    assert outside.sentence == "Slowed to 50 %: an outside source sees something at 0.30 m."


def test_a_row_slows_to_the_share_of_the_speed_that_it_leaves(step: ControlStep) -> None:
    near = {"obstacles": seen((0, 0.4, 0.2, 2), (1, 0.2, 0.12, 2)), "restricted": np.array([0])}
    found = said(step, **near, approach_limit=np.array([0.05]), qp=limited(), ee_velocity=0.35 * AHEAD)
    assert found == Explanation(Doing.SLOWED, "Slowed to 35 %: hand_front sees something at 0.20 m.")
    # eq. 3 and the row together: 0.5 * 0.4
    both = said(
        step, **near, approach_limit=np.array([0.05]), qp=limited(), speed_scale=0.5, desired_velocity=0.5 * AHEAD,
        ee_velocity=0.2 * AHEAD,
    )  # fmt: skip
    assert both.sentence == "Slowed to 20 %: hand_front sees something at 0.20 m."


def test_a_row_across_the_normal_is_said_of_what_is_nearest(step: ControlStep) -> None:
    # the solution says that a row is violated, and has none: those across a normal are not in it
    across = replace(limited(multiplier=0.0), slack=np.zeros(2), multipliers=np.zeros(9))
    near = {"obstacles": seen((0, 0.4, 0.2, 2), (1, 0.2, 0.06, 2)), "restricted": np.array([0, 1])}
    slow = {**near, "approach_limit": np.array([0.4, 0.2]), "ee_velocity": 0.4 * AHEAD}
    found = said(step, **slow, qp=replace(across, violated=True))
    assert found == Explanation(Doing.SLOWED, "Slowed to 40 %: hand_left sees something at 0.06 m.")
    assert said(step, **slow, qp=across).doing is Doing.MOVING


@pytest.mark.parametrize(
    ("limit", "words"), [(0.05, "link5 may near it at 0.05 m/s at most"), (-0.1, "link5 has to back away from it")]
)
def test_a_row_that_limits_the_direction_alone_names_unit_and_link(step: ControlStep, limit: float, words: str) -> None:
    found = said(
        step, obstacles=seen((1, 0.5, 0.15, 1)), restricted=np.array([0]), approach_limit=np.array([limit]),
        qp=limited(),
    )  # fmt: skip
    assert found == Explanation(Doing.MOVING, f"Moving, but hand_left sees something at 0.15 m, and {words}.")


def test_an_arm_kept_off_its_path_says_by_what_and_how_far_and_never_that_it_follows(step: ControlStep) -> None:
    # the page's old sentence at 0.05 m/s, pushed off the path: "Moving as requested."
    off = {"path_position": step.ee_position + np.array([0.0, 0.0, 0.12]), "obstacles": seen((1, 0.2, 0.06, 2))}
    near = {"restricted": np.array([0]), "approach_limit": np.array([0.02]), "qp": limited(slack=0.01)}
    found = said(step, **off, **near, desired_velocity=AHEAD / 6, ee_velocity=np.array([0.0, 0.05, 0.0]))
    assert found == Explanation(Doing.AVOIDING, "Kept 0.12 m from its path: hand_left sees something at 0.06 m.")
    still = said(step, **off, **near, ee_velocity=np.array([0.0, 0.01, 0.0]))
    assert still == Explanation(
        Doing.WAITING,
        "Waiting 0.12 m from its path: hand_left sees something at 0.06 m. It continues when the way is clear.",
    )
    back = AHEAD + np.array([0.0, 0.0, 0.2])
    assert said(step, path_position=off["path_position"], desired_velocity=back) == Explanation(
        Doing.RETURNING, "Returning to its path, 0.12 m away."
    )
    assert said(step, path_position=off["path_position"], desired_velocity=np.zeros(3)).doing is Doing.MOVING
    # 12 mm behind, as an arm that lags, and corrected by 1.5 times that a second: it follows
    behind, correction = step.ee_position + np.array([0.0, 0.0, 0.012]), AHEAD + np.array([0.0, 0.0, 0.018])
    assert said(step, path_position=behind, desired_velocity=correction).doing is Doing.MOVING
    slow = said(step, **off, speed_scale=0.4)
    assert (
        slow.sentence == "Slowed to 40 % on its way back to the path, 0.12 m away: hand_left sees something at 0.06 m."
    )


@pytest.mark.parametrize(
    ("unit", "age", "words"),
    [
        (0, 0.3, "hand_front sees something at 0.04 m"),
        (1, 2.04, "the arm remembers something at 0.04 m, seen 2 s ago by hand_left"),
        (2, 0.44, "the arm remembers something at 0.04 m, seen 0.44 s ago by an outside source"),
        (0, 11.7, "the arm remembers something at 0.04 m, seen 12 s ago by hand_front"),
    ],
)
def test_an_arm_that_stands_before_something_says_that_it_waits_and_whether_it_sees_or_remembers_it(
    step: ControlStep, unit: int, age: float, words: str
) -> None:
    near = {"obstacles": seen((unit, 0.1, 0.04, 2), age=age), "restricted": np.array([0]), "qp": limited(slack=0.01)}
    found = said(step, **near, approach_limit=np.zeros(1), ee_velocity=np.zeros(3))
    assert found == Explanation(Doing.WAITING, f"Waiting: {words}. It continues when the way is clear.")
    paper = said(step, obstacles=seen((0, 0.02, -0.01, 2)), speed_scale=0.02, ee_velocity=0.01 * AHEAD)
    assert paper.sentence == "Waiting: hand_front sees something at 0.00 m. It continues when the way is clear."


def touched(step: ControlStep, **changes: object) -> Explanation:
    at = Touched(np.array([1]), np.zeros((1, 3)), np.array([[0.0, 12.0, 5.0]]), np.zeros(1), np.ones(1))
    return said(
        step, **{
            "mode": Mode.REACT, "event": Event.YIELDING, "detail": "1 s after the last push",
            "evidence": 1.4, "touched": at, "reaction_velocity": np.array([0.0, 0.1, 0.0]), **changes,
        }
    )  # fmt: skip


def test_a_contact_that_moves_the_arm_is_said_with_link_force_and_speed(step: ControlStep) -> None:
    found = touched(step, ee_velocity=np.array([0.0, 0.12, 0.0]))
    assert found == Explanation(Doing.YIELDING, "Touched at link5 with 13 N: moving with the push at 0.12 m/s.")


def test_a_contact_that_does_not_move_the_arm_is_said_as_what_it_is(step: ControlStep) -> None:
    rest = {"command": np.full(7, 0.001), "reaction_velocity": np.zeros(3)}
    found = touched(step, **rest)
    assert found == Explanation(
        Doing.TOUCHED, "Touched at link5 with 13 N: held still, the push is below what moves the arm."
    )
    assert still(replace(step, mode=Mode.REACT, command=rest["command"]))
    assert not still(replace(step, mode=Mode.TRACK, command=rest["command"]))


def test_a_contact_that_would_move_the_arm_into_something_names_the_unit(step: ControlStep) -> None:
    found = touched(
        step, command=np.zeros(7), obstacles=seen((0, 0.2, 0.03, 2)), restricted=np.array([0]),
        approach_limit=np.zeros(1), qp=limited(),
    )  # fmt: skip
    assert found.sentence == "Touched at link5 with 13 N: held still, because hand_front sees something at 0.03 m."


def test_a_new_contact_is_said_by_its_force_and_one_that_has_ended_with_what_follows(step: ControlStep) -> None:
    new = touched(step, touched=step.touched, contact=Contact(np.array([0.0, -8.0, 6.0]), np.ones(3, bool)))
    assert new == Explanation(Doing.TOUCHED, "Touched with 10 N.")
    over = {"touched": step.touched, "evidence": 0.2}
    ended = touched(step, **over, command=np.zeros(7))
    assert ended == Explanation(Doing.WAITING, "The push has ended. The task continues 1 s after the last push.")
    eq_12 = touched(step, **over, event=Event.REACTING, detail="1.20 s")
    assert eq_12 == Explanation(Doing.YIELDING, "Moving in the direction of the push for another 1.20 s.")


def test_a_force_without_a_place_is_the_estimate_less_its_mean_and_nothing_where_there_is_none(
    step: ControlStep,
) -> None:
    found = touched(step, touched=step.touched, force=np.array([1.0, 13.0, 10.0]))  # 1 N of it is the mean
    assert found.sentence.startswith("Touched with 15 N: ")
    assert touched(step, touched=step.touched, force=np.full(3, np.nan)).sentence.startswith("Touched: ")


def test_a_clamp_is_said_as_such(step: ControlStep) -> None:
    reason = "Clamped between two objects (5.0 Nm against the direction of yielding): opening along its path."
    assert touched(step, event=Event.OPENING, reason=reason) == Explanation(Doing.CAUGHT, reason)


def test_a_hold_says_its_cause_and_is_a_stop_where_a_person_has_to_resume(step: ControlStep) -> None:
    silent = "No usable reading from hand_left: check it; the arm continues when it reports again."
    assert said(step, mode=Mode.HOLD, event=Event.SKIN_SILENT, reason=silent) == Explanation(Doing.WAITING, silent)
    tries = "The arm gave up after 3 contacts: clear it; the arm tries again when 30 s have passed, or on resume."
    assert said(step, mode=Mode.HOLD, event=Event.GIVEN_UP, reason=tries).doing is Doing.STOPPED
    assert said(step, mode=Mode.HOLD, event=Event.UNUSABLE, latched=True).doing is Doing.STOPPED


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.event.name)
def test_what_latches_says_that_a_person_has_to_resume_and_nothing_else_promises_it(row: Transition) -> None:
    if row.event is not Event.LATCHED:  # a hold that lasts says what it said
        assert ("resume" in row.sentence) == row.latches


def test_a_commander_reads_off_what_limits_the_arm_by_how_much_and_who_sees_it(step: ControlStep) -> None:
    assert step.limited == Limited(Limit.NOTHING, 1.0)
    near = {"obstacles": seen((0, 0.4, 0.2, 2), (1, 0.2, 0.12, 1)), "restricted": np.array([0])}
    row = replace(step, **near, approach_limit=np.array([0.05]), qp=limited(), ee_velocity=0.35 * AHEAD)
    assert row.limited == Limited(Limit.APPROACH, pytest.approx(0.35), obstacle=0, unit=0, link=2)
    slowed = replace(step, obstacles=near["obstacles"], speed_scale=0.17)
    assert slowed.limited == Limited(Limit.SLOWED, 0.17, obstacle=1, unit=1, link=1)
    assert replace(step, speed_scale=0.17).limited == Limited(Limit.SLOWED, 0.17)
    fast = replace(step.qp, multipliers=np.array([0.0, 0.1, 0.0, -0.4, 0.0, 0.0, 0.0]))
    assert replace(step, qp=fast, ee_velocity=0.5 * AHEAD).limited == Limited(Limit.JOINTS, pytest.approx(0.5), joint=3)
    touched = Touched(np.array([2]), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), np.ones(1))
    assert replace(step, mode=Mode.REACT, touched=touched).limited == Limited(Limit.CONTACT, 0.0, link=2)
    assert replace(step, mode=Mode.HOLD).limited == Limited(Limit.HOLD, 0.0)
