"""What a person is told of a run."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.profiles import PROFILES
from pretouch.sensing.skin import Skin
from pretouch.session.progress import ProgressReporter, RunSummary
from pretouch.types import Contact, Mode
from tests.following_arm import Arm


class Sink:
    def __init__(self):
        self.cycles = []

    def record(self, cycle):
        self.cycles.append(cycle)


@pytest.fixture
def watched(panda_model, paper_skin):
    """An arm under a controller, a watcher of it, what it told, and how to turn both."""
    arm, told, sink = Arm(panda_model, paper_skin), [], Sink()
    reporter = ProgressReporter(sink, told.append, " Press Enter.", arm.controller)

    def turn(cycles, **given):
        for _ in range(cycles):
            reporter.record(arm.turn(**given))

    return reporter, told, sink, turn


def test_each_change_is_told_once_and_all_is_handed_on(watched):
    reporter, told, sink, turn = watched
    turn(150)
    assert [sentence.split()[0] for sentence in told] == ["HOLD", "TRACK"]
    assert len(sink.cycles) == reporter.summary.steps == 150
    (held,) = reporter.summary.holds.items()
    assert held[0].startswith("The force window is filling")
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
    assert reaction == "REACT Moving the way it was pushed: 0.99 s left."
    assert 1 <= len(lines) <= 3
    assert all(line == "TRACK In its place: nothing near is seen." for line in lines[1:])
    assert any("1 contact." in sentence for sentence in reporter.summary.sentences(0.01))


@pytest.mark.parametrize("without", ["units", "perception"])
def test_where_nothing_can_see_it_is_not_said_that_nothing_is_seen(panda_model, paper_skin, without):
    skin = Skin([], panda_model) if without == "units" else paper_skin
    arm, sentences = Arm(panda_model, skin, PROFILES["paper" if without == "units" else "blind"]), []
    reporter = ProgressReporter(Sink(), sentences.append, "", arm.controller)
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


def test_a_contact_that_does_not_move_the_arm_is_counted_as_what_it_is(watched):
    reporter, _, _, turn = watched
    turn(120)
    still = {"mode": Mode.REACT, "command": np.zeros(7), "reaction_velocity": np.zeros(3)}
    moves = {"mode": Mode.REACT, "command": np.full(7, 0.1), "reaction_velocity": np.full(3, 0.1)}
    contact = Contact(np.array([0.0, 9.0, 0.0]), np.ones(3, bool))
    for changes in ({**still, "contact": contact}, still, {}, {**moves, "contact": contact}, moves, {}):
        turn(1)
        cycle = reporter._further.cycles[-1]
        reporter.record(replace(cycle, step=replace(cycle.step, **changes)))
    assert (reporter.summary.contacts, reporter.summary.unmoved) == (2, 1)
    assert "2 contacts, 1 of which did not move the arm." in reporter.summary.sentences(0.01)[0]
