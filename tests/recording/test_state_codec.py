"""The controller's state to a message and back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.contact.window import window_init
from pretouch.errors import RecordingError
from pretouch.modes import Event, ModeState
from pretouch.recording.messages import decoded, encoded
from pretouch.recording.state_codec import STATE, decode_state, encode_state
from pretouch.types import Mode
from tests.fuzz.invariants import same
from tests.recording.runs import Run, controller_of


@pytest.fixture(scope="module")
def states(panda_model, paper_skin):
    run = Run(controller_of(panda_model, paper_skin), seed=3)
    for _ in range(60):
        run.turn()
    return [cycle.before for cycle in run.cycles]


def test_each_state_of_a_run_comes_back_to_the_bit(states):
    for state in states:
        anew, back = decode_state(encode_state(4, state, True))
        assert anew
        assert same(back, state)


NUMBER = st.floats() | st.sampled_from([-0.0, np.inf, -np.inf, 5e-324])


@given(NUMBER, st.integers(0, 300), st.booleans(), st.integers(0, 2**53), st.sampled_from(Mode), st.integers(0, 5),
       st.sampled_from(Event))  # fmt: skip
def test_any_numbers_counts_and_lengths_come_back(states, number, samples, latched, count, mode, sent, event):
    state = states[-1]
    watch = replace(state.watch, stamp=number, sent=tuple((number, np.full(7, number)) for _ in range(sent)))
    window = replace(window_init(max(1, samples)), count=count)
    odd = replace(
        state, watch=watch, window=window, mode=ModeState(mode, event, "Für", "Für ä: 'x'.", latched),
        tracks=replace(state.tracks, point=np.full((0, 3), number)), command=np.full(7, number),
    )  # fmt: skip
    anew, back = decode_state(encode_state(0, odd, False))
    assert not anew
    assert same(back, odd)


@pytest.mark.parametrize("tau_ext", [None, "many", np.zeros((2, 2), np.float32), [1, 2]])
def test_what_no_step_reads_may_be_anything(states, tau_ext):
    state = states[-1]
    robot = replace(state.watch.robot, tau_ext=tau_ext, wrench=None)
    _, back = decode_state(encode_state(0, replace(state, watch=replace(state.watch, robot=robot)), False))
    assert back.watch.robot.wrench is None
    assert same(replace(back.watch.robot, tau_ext=None), replace(robot, tau_ext=None))


def test_a_state_of_another_version_is_refused_with_what_differs(states):
    message = decoded(STATE, encode_state(0, states[-1], False))
    message.name[3] = "watch.robot.elbow"
    with pytest.raises(RecordingError, match=r"another version.*watch\.robot\.elbow"):
        decode_state(encoded(STATE, message))
    message.name = message.name[:3]
    message.kind, message.shape = message.kind[:3], message.shape[:3]
    with pytest.raises(RecordingError, match="another version"):
        decode_state(encoded(STATE, message))
