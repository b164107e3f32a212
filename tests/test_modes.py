"""The transition table: one mode for every set of events, causes that latch, and sentences that say why."""

from itertools import chain, combinations

import pytest

from pretouch.modes import TABLE, Event, ModeState, mode_init, next_mode
from pretouch.types import Mode

LATCHING = [Event.UNUSABLE, Event.TIME_BACKWARDS, Event.STATE_STALE, Event.SOLVER_FAILED]
PASSING = [
    Event.SKIN_UNFIT, Event.SKIN_SILENT, Event.POINTS_LOST, Event.LOAD_UNFIT,
    Event.DESIRED_UNFIT, Event.DESIRED_STALE, Event.NO_FORCE, Event.OVERRUN,
    Event.GIVEN_UP, Event.WINDOW_FILLING,
]  # fmt: skip
GOING = [Event.REACTING, Event.OPENING, Event.YIELDING]
FAULTS = [Event.UNUSABLE, Event.SOLVER_FAILED]  # the other two stand beside them
REPORTED = [*FAULTS, Event.BLOCKED, *GOING, Event.CLAMPED, Event.CONTACT, *PASSING]
STATES = [
    ModeState(Mode.TRACK, Event.CLEAR, reason="before"), ModeState(Mode.REACT, Event.REACTING, reason="before"),
    ModeState(Mode.HOLD, Event.OVERRUN, reason="before"),
    ModeState(Mode.HOLD, Event.UNUSABLE, reason="before", latched=True),
]  # fmt: skip


def expected(state: ModeState, events: dict[Event, str], resume: bool) -> tuple[Mode, bool, Event | None]:
    """The rules of the table in words: next mode, whether it latches, and the event that explains it."""
    for fault in LATCHING:  # what makes the inputs or the answer unusable comes before everything
        if fault in events:
            return Mode.HOLD, True, fault
    if Event.BLOCKED in events and state.mode is not Mode.HOLD:  # found by a step that means to move: brakes it
        return (Mode.HOLD if state.mode is Mode.TRACK else Mode.REACT), False, Event.BLOCKED
    if state.latched and not resume:  # only a person ends a latched hold
        return Mode.HOLD, True, None
    if state.mode is Mode.REACT:  # one reaction at a time, to its end
        if Event.REACTING in events:
            return Mode.REACT, False, Event.REACTING
        if Event.CLAMPED in events:  # caught, and opened as far as it can
            return Mode.HOLD, True, Event.CLAMPED
        for going in GOING:
            if going in events:
                return Mode.REACT, False, going
    elif Event.CONTACT in events:  # a push is answered even while holding
        return Mode.REACT, False, Event.CONTACT
    for cause in PASSING:
        if cause in events:
            return Mode.HOLD, False, cause
    return Mode.TRACK, False, None


@pytest.mark.parametrize("resume", [False, True])
@pytest.mark.parametrize("state", STATES, ids=lambda s: f"{s.mode.value}{'-latched' if s.latched else ''}")
def test_each_set_of_events_ends_in_the_mode_the_rules_say(state: ModeState, resume: bool):
    # all of up to three events: the first row that applies decides, so pairs show the order of the rows
    for chosen in chain.from_iterable(combinations(REPORTED, k) for k in range(4)):
        events = {event: f"<{event.name}>" for event in chosen}
        after = next_mode(state, events, resume)
        mode, latched, cause = expected(state, events, resume)
        assert (after.mode, after.latched) == (mode, latched)
        kept = state.event if latched and cause is None else cause or Event.CLEAR
        assert after.event is kept
        # the sentence carries the detail of its cause and of no other
        told = [] if cause in (None, Event.BLOCKED) else [cause]
        assert [e for e in events if f"<{e.name}>" in after.reason] == told
        assert ("acceleration limits" in after.reason) == (cause is Event.BLOCKED)
        assert "{" not in after.reason
        if latched and cause is None:
            assert after.reason == "before"


def test_every_event_has_a_row_and_only_a_hold_latches():
    assert {row.event for row in TABLE} == set(Event)
    assert all(row.target is Mode.HOLD for row in TABLE if row.latches)
    assert not any(row.soft for row in TABLE if row.event in LATCHING), "a state that is not known moves no arm"


@pytest.mark.parametrize("cause", LATCHING)
def test_a_latched_hold_lasts_until_a_person_resumes(cause: Event):
    state = next_mode(ModeState(Mode.TRACK, Event.CLEAR), {cause: "why"}, resume=False)
    for _ in range(10):
        state = next_mode(state, {}, resume=False)
        assert state.mode is Mode.HOLD
        assert "why" in state.reason
        assert "resume" in state.reason
    still = next_mode(state, {cause: "still"}, resume=True)
    assert still.mode is Mode.HOLD
    assert still.latched
    assert next_mode(state, {}, resume=True).mode is Mode.TRACK


def test_the_arm_holds_before_its_first_step():
    assert mode_init().mode is Mode.HOLD
    assert not mode_init().latched
