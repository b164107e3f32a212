"""What a file keeps of control cycles: to bytes and back, to the bit."""

import struct
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import get_types_from_msg

from pretouch.contact.window import window_init
from pretouch.errors import RecordingError
from pretouch.loop import Cycle
from pretouch.modes import Event, ModeState
from pretouch.recording.cycles import Cycles, KeptInputs, KeptState, inputs_of, packed_inputs, packed_state
from pretouch.recording.packing import unpacked
from pretouch.recording.ros import (
    OWN,
    decoded,
    definition,
    encode,
    hints_of,
    is_record,
    messages,
    own,
    own_definition,
    value_of,
)
from pretouch.recording.simulation import Truth, truth_of
from pretouch.records import Flat
from pretouch.types import Contact, ControlStep, Inputs, Mode, RangeReadings, RobotState, Thresholds, Touched
from tests.fuzz.invariants import same
from tests.recording.runs import Run

SEED = st.integers(0, 2**32)
TOUCHED = Touched(np.zeros(1, np.int64), np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), np.zeros(1))


def any_like(rng: np.random.Generator, value: Any) -> Any:
    """A value like another one, its numbers of any bits and its texts of any characters; NaN has no payload."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        bits = np.frombuffer(rng.bytes(value.nbytes)).reshape(value.shape)
        usual = rng.choice([0.0, -0.0, 1.0, np.nan, np.inf, -np.inf, 5e-324, 0.1], value.shape)
        return np.where(np.isnan(bits) | (rng.random(value.shape) < 0.3), usual, bits)
    if isinstance(value, np.ndarray):
        return rng.integers(2 if value.dtype == np.bool_ else 2**62, size=value.shape).astype(value.dtype)
    if is_record(type(value)):
        return type(value)(*(any_like(rng, getattr(value, name)) for name, _ in hints_of(type(value))))
    if isinstance(value, Enum):
        return list(type(value))[rng.integers(len(type(value)))]
    if isinstance(value, str):
        return "".join(rng.choice([*"aZ 'ä\n\t€", "\U0001f9be", "\ue000"], rng.integers(20)))
    if isinstance(value, bool):
        return bool(rng.integers(2))
    return value if value is None else float(any_like(rng, np.array([value]))[0])


@pytest.fixture(scope="module")
def run(controller):
    run = Run(controller, seed=3)
    for _ in range(60):
        run.turn()
    return run


@given(SEED, st.integers(-1, 2**62))
def test_inputs_come_back_to_the_bit_whatever_their_lengths(seed, points_at):
    rng = np.random.default_rng(seed)
    rows = [any_like(rng, np.zeros(rng.integers(9))) for _ in range(7)]
    wrench = (None, *(any_like(rng, np.zeros(n)) for n in (0, 6, 7)))[rng.integers(4)]
    readings = RangeReadings(*rows[5:], rng.integers(-(2**63), 2**63, rng.integers(9)))
    inputs = any_like(rng, Inputs(0.0, RobotState(0.0, *rows[:5], wrench), readings, False))
    assert same(inputs_of(packed_inputs(inputs, points_at)), KeptInputs(inputs, points_at, ""))


@given(SEED)
def test_a_step_comes_back_to_the_bit_in_fresh_arrays_and_damage_is_no_worse_than_a_recording_error(run, seed):
    rng = np.random.default_rng(seed)
    step = run.cycles[seed % 60].step
    step = any_like(rng, replace(step, touched=TOUCHED) if rng.integers(2) else step)
    data = encode(step, 7)
    back = value_of(ControlStep, data)
    assert struct.unpack_from("<Q", data, 4)[0] == decoded(own("Step"), data).sequence == 7
    assert same(back, step)
    assert encode(back, 7) == data
    for array in (back.q, back.obstacles.point, back.obstacles.unit, back.thresholds.lower, back.command):
        assert array.flags.aligned
        assert array.flags.writeable
        assert array.flags.c_contiguous
    cut, at = rng.integers(len(data), size=2)
    for spoiled in (data[:cut], data[:at] + rng.bytes(1) + data[at + 1 :]):
        with suppress(RecordingError):
            value_of(ControlStep, spoiled)


@given(SEED)
def test_truth_comes_back_to_the_bit(seed):
    nothing = Truth(np.zeros(4), np.zeros((4, 3)), np.zeros(3), np.zeros(2), np.zeros(2, np.int64), np.zeros((2, 3)))
    truth = any_like(np.random.default_rng(seed), nothing)
    assert same(value_of(Truth, encode(truth, 3)), truth)


def test_what_a_simulation_logged_is_gathered_as_it_is():
    log = [(0.5, np.array([1.0, 2.0, 3.0])), (0.501, np.zeros(3))]
    touch = (0.501, 4, np.array([0.0, 0.1, 0.0]))
    truth = truth_of(log, [touch], np.array([0.7, 0.0, 0.4]))
    assert truth.time.tolist() == [0.5, 0.501]
    assert truth.force.tolist() == [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]
    assert truth.hand.tolist() == [0.7, 0.0, 0.4]
    assert [(time, link, v.tolist()) for time, link, v in truth.touches] == [(0.501, 4, [0.0, 0.1, 0.0])]
    nothing = value_of(Truth, encode(truth_of([], [], None), 3))
    assert (nothing.force.shape, len(nothing.touches), np.isnan(nothing.hand).all()) == ((0, 3), 0, True)


def usual() -> Inputs:
    readings = RangeReadings(np.zeros(7), np.full(7, 0.5), np.zeros(7, np.int64))
    return Inputs(1.0, RobotState(1.0, *(np.zeros(7) for _ in range(5)), np.zeros(6)), readings)


class Hostile:
    """Something that fails however it is looked at."""

    def __repr__(self) -> str:
        raise RuntimeError("no")


SPOILED = [
    lambda i: replace(i, robot=None),
    lambda i: replace(i, readings=None),
    lambda i: replace(i, robot=replace(i.robot, q="seven numbers")),
    lambda i: replace(i, robot=replace(i.robot, q=[1.0, None])),
    lambda i: replace(i, robot=replace(i.robot, qd=np.zeros(7, complex))),
    lambda i: replace(i, readings=replace(i.readings, status=["OK"] * 7)),
    lambda i: replace(i, stamp=10**400),
    lambda i: replace(i, payload=0.7),
    lambda i: replace(i, robot=Hostile()),
    lambda i: Hostile(),
    lambda i: replace(i, robot=SimpleNamespace(q="\ud800\0" * 1000)),
]


@pytest.mark.parametrize("spoil", SPOILED)
def test_inputs_that_cannot_be_kept_are_none_and_said(run, spoil):
    cycle = run.cycles[3]
    kept = Cycles(run.controller, {}).keep(Cycle(spoil(cycle.inputs), cycle.before, cycle.step, cycle.after))
    back = inputs_of(kept.inputs)
    assert back.inputs is None
    assert 0 < len(back.unreadable) < 5000


@pytest.mark.parametrize(
    ("change", "same_as"),
    [
        *((change, change) for change in (
            lambda i: replace(i, robot=replace(i.robot, q=np.zeros((7, 1)))),
            lambda i: replace(i, robot=replace(i.robot, tau_ext=np.zeros((2, 3), np.float32))),
            lambda i: replace(i, readings=replace(i.readings, status=np.zeros(7, np.uint8))),
            lambda i: replace(i, readings=replace(i.readings, status=np.zeros(7))),
        )),
        (lambda i: replace(i, stamp=1), lambda i: i),
        (lambda i: replace(i, stamp=np.float32(1.0)), lambda i: i),
        (lambda i: replace(i, robot=replace(i.robot, q=[0.0] * 7)), lambda i: i),
        (lambda i: replace(i, robot=replace(i.robot, q=np.zeros(14)[::2])), lambda i: i),
        (lambda i: replace(i, robot=replace(i.robot, tau_ext="none")),
         lambda i: replace(i, robot=replace(i.robot, tau_ext=np.zeros(0)))),
    ],
)  # fmt: skip
def test_arrays_of_other_types_and_shapes_are_kept_as_they_are_and_numbers_as_the_controller_takes_them(
    change, same_as
):
    assert same(inputs_of(packed_inputs(change(usual()))).inputs, same_as(usual()))


def test_each_state_of_a_run_comes_back_to_the_bit(run):
    for cycle in run.cycles:
        assert same(unpacked(KeptState, packed_state(cycle.before, True)), KeptState(True, cycle.before))


ANY = st.floats() | st.sampled_from([-0.0, np.inf, -np.inf, 5e-324])


@given(ANY, st.integers(0, 300), st.booleans(), st.integers(0, 2**53), st.sampled_from(Mode), st.sampled_from(Event))
def test_any_numbers_counts_and_lengths_come_back(run, number, samples, latched, count, mode, event):
    memory = Flat.of(window_init(samples)._replace(samples=np.full(1, count), sums=np.full((4, 3), number)))
    odd = replace(
        run.cycles[-1].before, memory=memory, mode=ModeState(mode, event, "Für", "Für ä: 'x'.", latched)
    )  # fmt: skip
    assert same(unpacked(KeptState, packed_state(odd, False)), KeptState(False, odd))


def test_a_state_of_another_version_is_refused_with_what_differs(run):
    data = packed_state(run.cycles[-1].before, False)
    with pytest.raises(RecordingError, match=r"reaction.*from another version"):
        unpacked(KeptState, data.replace(b"reaction", b"reacsion"))
    with pytest.raises(RecordingError, match="cannot be read"):
        unpacked(KeptState, data[:-9])


class Listed(NamedTuple):
    parts: tuple[object, ...]


class Chained(NamedTuple):
    here: object
    rest: "Chained | None"


@pytest.mark.parametrize(
    ("remembered", "words"),
    [
        ((1.0,), "remembers a tuple, which a recording cannot hold: let it remember a number"),
        (Listed((np.zeros(2), np.ones(3))), "remembers a Listed with `object` within parts, which"),
        (Listed((Contact(np.zeros(3), np.zeros(3, bool)),)), "a Listed with `object` within parts, which"),
        (Chained(1.0, None), "remembers a Chained with `object` within rest, which"),
        (Thresholds(*np.zeros((6, 3))), "No named part of a profile has Thresholds as its `State`: name the class"),
    ],
)
def test_what_a_part_remembers_and_no_recording_can_hold_is_named(run, remembered, words):
    with pytest.raises(RecordingError, match=words):
        packed_state(replace(run.cycles[-1].before, reaction=remembered), False)


def test_the_rows_of_the_thresholds_have_their_names(run):
    step = replace(run.cycles[0].step, thresholds=Thresholds(*np.arange(18.0).reshape(6, 3)))
    message = decoded(own("Step"), encode(step, 0)).thresholds
    for name, _ in messages().store.fielddefs[own("Thresholds")][1]:
        assert getattr(message, name).tobytes() == getattr(step.thresholds, name).tobytes()


def test_an_array_of_another_type_than_its_field_is_refused(run):
    with pytest.raises(ValueError, match="q is an array of float32, not float64"):
        encode(replace(run.cycles[0].step, q=np.zeros(7, np.float32)), 0)


@pytest.mark.parametrize("name", OWN)
def test_each_field_of_a_message_file_is_explained_and_the_definition_that_is_embedded_can_be_parsed_alone(name):
    lines = [line for line in own_definition(name).splitlines() if line]
    assert lines[0].startswith("#")
    assert all("#" in line for line in lines if line.split()[0] not in OWN)
    assert all(len(line) <= 120 for line in lines)
    for kind, defined in get_types_from_msg(definition(own(name)), own(name)).items():
        assert defined == messages().store.fielddefs[kind]
