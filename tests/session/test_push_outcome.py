"""What is said of pushes, by steps made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.modes import Event
from pretouch.session.push_outcome import PushOutcome
from pretouch.types import Contact, ControlStep, Mode, Obstacles, QpOutcome, QpSolution, Thresholds

FORCE = np.array([0.0, 15.0, 0.0])


@pytest.fixture
def step() -> ControlStep:
    """A step whose thresholds are 11 and -9 N about a mean of 1 N, and whose force is 9 N along y."""
    zero, parts, none = np.zeros(3), np.zeros((6, 3)), np.zeros(0)
    parts[0], parts[1], parts[2] = 11.0, -9.0, 1.0
    empty = Obstacles(
        none.astype(int), np.zeros((0, 3)), none, np.zeros((0, 3)), none.astype(int), np.zeros((0, 3)), none, none
    )
    return ControlStep(
        stamp=0.0, mode=Mode.TRACK, event=Event.CLEAR, detail="", reason="Moving as asked.", latched=False,
        q=np.zeros(7), q_commanded=np.zeros(7),
        ee_position=zero, ee_velocity=zero, path_position=zero, path_phase=0.0, desired_velocity=zero,
        speed_scale=1.0, range_distance=none, obstacles=empty, force=zero,
        filtered_force=np.array([1.0, 9.0, 1.0]), thresholds=Thresholds(parts), armed=True, contact=None,
        reaction_velocity=zero, restricted=none.astype(int), approach_limit=none,
        qp=QpSolution(np.zeros(7), none, np.zeros(7), QpOutcome.SOLVED, "solved"), command=np.full(7, 0.1),
        residual=np.zeros(7), evidence=0.8,
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
    said = outcome(step, all={"mode": Mode.HOLD, "reason": "The force window is filling.", "evidence": 0.0})
    assert said == "The push of 15 N was not detected: the arm held (The force window is filling)."


@pytest.mark.parametrize(
    ("velocity", "command", "answer"),
    [(0.1, 0.1, "the arm moved with it"), (0.0, 0.0, "the arm held still: it was below what moves the arm")],
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
