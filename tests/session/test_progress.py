"""What a person is told of a run."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.profiles import PROFILES
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.session.progress import ProgressReporter, PushOutcome, RunSummary
from pretouch.types import Contact, ControlStep, Mode, Thresholds
from tests.following_arm import Arm
from tests.reporting import made


@pytest.fixture
def watched(panda_model, paper_skin):
    """An arm under a controller, a watcher of it, what it told, the cycles it handed on, and how to turn both."""
    arm, told, cycles = Arm(panda_model, paper_skin), [], []
    reporter = ProgressReporter(SimpleNamespace(record=cycles.append), told.append, " Press Enter.", arm.controller)

    def turn(count, **given):
        for _ in range(count):
            reporter.record(arm.turn(**given))

    return reporter, told, cycles, turn


def test_each_change_is_told_once_and_all_is_handed_on(watched):
    reporter, told, cycles, turn = watched
    turn(150)
    assert [sentence.split()[0] for sentence in told] == ["HOLD", "TRACK"]
    assert len(cycles) == reporter.summary.steps == 150
    (held,) = reporter.summary.holds.items()
    assert held[0].startswith("Measuring the arm's torques")
    assert held[1] == pytest.approx(1.0, abs=0.02)


def test_a_hold_that_latches_says_what_to_do(watched):
    _, told, _, turn = watched
    turn(120)
    turn(1, change=lambda robot: replace(robot, q=np.full(7, np.nan)))
    assert told[-1].startswith("HOLD  The robot's state cannot be used")
    assert told[-1].endswith("then resume. Press Enter.")


def test_silent_units_are_named_although_the_arm_held_before(watched):
    _, told, _, turn = watched
    turn(10)
    turn(120, silent=dict.fromkeys(range(7), 1.0))
    assert any("No usable reading" in sentence for sentence in told)


def test_a_hold_of_a_moment_is_not_counted():
    summary = RunSummary(steps=200, holds={"The window fills.": 1.0, "A unit was late.": 0.01})
    assert summary.sentences(0.01) == ("200 control steps, 2.0 s; 0 contacts.", "Held for 1.0 s: The window fills.")


def test_contacts_are_counted_and_a_line_comes_every_five_seconds(watched):
    reporter, told, _, turn = watched
    turn(150)
    turn(40, force=(0.0, 25.0, 0.0))
    assert reporter.summary.contacts == 1
    assert any(sentence.startswith("REACT") for sentence in told)
    before = len(told)
    turn(900)
    reaction, *lines = told[before:]
    assert reaction == "REACT Moving in the direction of the push for another 0.99 s."
    assert 1 <= len(lines) <= 3
    assert all(line == "TRACK In position: nothing near is seen." for line in lines[1:])
    assert any("1 contact." in sentence for sentence in reporter.summary.sentences(0.01))


def test_an_arm_that_waits_for_something_says_so_before_the_five_seconds_have_passed(watched, panda_model):
    reporter, told, _, _ = watched
    for i in range(300):
        there = {"near": [(0, "panda_hand", 0.04, 0.1)], "speed_scale": 0.0} if i >= 150 else {}
        reporter.record(SimpleNamespace(step=made.step(panda_model, stamp=0.01 * i, **there)))
    waiting = "Waiting: hand_left sees something at 0.04 m. It continues when the way is clear."
    assert told == ["TRACK In position: nothing near is seen.", f"TRACK {waiting}"]


@pytest.mark.parametrize("without", ["units", "perception"])
def test_where_nothing_can_see_it_is_not_said_that_nothing_is_seen(panda_model, paper_skin, without):
    skin = Skin([], panda_model) if without == "units" else paper_skin
    arm, sentences = Arm(panda_model, skin, PROFILES["paper" if without == "units" else "blind"]), []
    reporter = ProgressReporter(SimpleNamespace(record=id), sentences.append, "", arm.controller)
    for _ in range(120):
        reporter.record(arm.turn())
    assert sentences[-1].endswith(": no sensor unit is in use.")


def test_a_force_that_was_nearly_a_contact_is_told_with_what_it_lacked(watched):
    _, told, _, turn = watched
    turn(120)
    before = len(told)
    turn(150, force=(0.0, 11.0, 0.0))
    turn(300)
    (said,) = [line for line in told[before:] if "not taken for a contact" in line]
    assert said.startswith("TRACK A force was not taken for a contact: the filtered force came to ")
    assert said.endswith(" N would have been a contact then.")


# what is said of pushes, by steps made by hand


FORCE = np.array([0.0, 15.0, 0.0])


@pytest.fixture
def step(panda_model: RobotModel) -> ControlStep:
    """A step whose thresholds are 11 and -9 N about a mean of 1 N, and whose force is 9 N along y."""
    parts = np.repeat([11.0, -9.0, 1.0, 0.0, 0.0, 0.0], 3).reshape(6, 3)
    return made.step(
        panda_model, filtered_force=np.array([1.0, 9.0, 1.0]), thresholds=Thresholds(*parts), evidence=0.8,
        command=np.full(7, 0.1),
    )  # fmt: skip


def outcome(step: ControlStep, **at: dict[str, object]) -> str:
    """What is said of a push of 15 N from 1 to 2 s, in steps of 0.1 s of which some are different."""
    push, said = PushOutcome(FORCE, 1.0, 1.0), []
    for i in range(5, 24):
        changes = at.get(f"t{i}", at.get("all", {}))
        said.append(push.take(replace(step, stamp=i / 10, **changes)))  # type: ignore[arg-type]
    assert not any(said[:-1])  # before 2.3 s the outcome is not known
    return said[-1]


def test_a_push_below_its_threshold_says_both_numbers(step: ControlStep) -> None:
    assert outcome(step) == (
        "The push of 15 N was not detected: the filtered force came to 8.0 N along y, and 10.0 N would have been a"
        " contact then."
    )


def test_a_push_that_a_test_of_the_torques_misses_says_the_evidence(step: ControlStep) -> None:
    said = outcome(step, all={"evidence": 0.31}, t17={"evidence": 0.62})
    assert said == "The push of 15 N was not detected: the evidence came to 0.62, and 1 would have been a contact."


def test_a_push_of_an_arm_that_holds_says_why_it_holds(step: ControlStep) -> None:
    said = outcome(step, all={"mode": Mode.HOLD, "reason": "Measuring the arm's torques.", "evidence": 0.0})
    assert said == "The push of 15 N was not detected: the arm held (Measuring the arm's torques)."


@pytest.mark.parametrize(
    ("velocity", "command", "answer"),
    [(0.1, 0.1, "the arm moved with it"), (0.0, 0.0, "the arm held still: the push was too weak to move it")],
)
def test_a_push_that_is_detected_says_when_and_what_the_arm_did(
    step: ControlStep, velocity: float, command: float, answer: str
) -> None:
    found = {"mode": Mode.REACT, "contact": Contact(FORCE, np.ones(3, bool)), "reaction_velocity": np.full(3, 0.1)}
    react = {"mode": Mode.REACT, "reaction_velocity": np.full(3, velocity), "command": np.full(7, command)}
    said = outcome(step, t12=found, t13=react, t14=react)
    assert said == f"The push of 15 N was detected after 0.20 s, and {answer}."


def test_a_push_into_a_reaction_is_none_of_its_own(step: ControlStep) -> None:
    assert outcome(step, all={"mode": Mode.REACT}) == "The push of 15 N came while the arm was yielding already."
