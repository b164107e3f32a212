"""What a file keeps of control cycles: to bytes and back, to the bit."""

import struct
from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from rosbags.typesys import get_types_from_msg

from pretouch.contact.window import window_init
from pretouch.errors import RecordingError
from pretouch.loop import Cycle
from pretouch.modes import Event, ModeState
from pretouch.recording.cycles import Cycles, KeptInputs, KeptState, inputs_of, packed_inputs, packed_state
from pretouch.recording.packing import unpacked
from pretouch.recording.ros import OWN, decoded, definition, encode, hints_of, messages, own, own_definition, value_of
from pretouch.recording.simulation import Truth, truth_of
from pretouch.records import Flat
from pretouch.types import (
    Contact,
    ControlStep,
    Inputs,
    Mode,
    Obstacles,
    QpOutcome,
    QpSolution,
    RangeReadings,
    RobotState,
    Thresholds,
    Touched,
)
from tests.fuzz.invariants import same
from tests.recording.runs import Run

NUMBER = st.floats(allow_nan=False)  # NaN with a payload is compared as NaN elsewhere
NAN_TOO = st.one_of(NUMBER, st.just(float("nan")))
TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)


def rows(*shape: int) -> st.SearchStrategy[np.ndarray]:
    return npst.arrays(np.float64, shape, elements=NAN_TOO)


def wholes(count: int) -> st.SearchStrategy[np.ndarray]:
    return npst.arrays(np.int64, count)


ROW, WHOLE = st.integers(0, 8).flatmap(rows), st.integers(0, 8).flatmap(wholes)
ROBOTS = st.builds(RobotState, NAN_TOO, ROW, ROW, ROW, ROW, ROW, st.none() | rows(6) | rows(0) | rows(7))
INPUTS = st.builds(Inputs, NAN_TOO, ROBOTS, st.builds(RangeReadings, ROW, ROW, WHOLE), st.booleans())


@st.composite
def steps(draw: st.DrawFn) -> ControlStep:
    n, k, m, units = (draw(st.integers(0, 8)) for _ in range(4))
    row = rows(3)
    obstacles = Obstacles(
        draw(wholes(k)), draw(rows(k, 3)), draw(rows(k)), draw(rows(k, 3)), draw(wholes(k)), draw(rows(k, 3)),
        draw(rows(k)), draw(rows(k)),
    )  # fmt: skip
    contact = st.builds(Contact, row, npst.arrays(np.bool_, 3))
    outcome = draw(st.sampled_from(QpOutcome))
    qp = QpSolution(draw(rows(n)), draw(rows(m)), draw(rows(n + m)), outcome, draw(TEXT), draw(st.booleans()))
    return ControlStep(
        stamp=draw(NAN_TOO), mode=draw(st.sampled_from(Mode)), event=draw(st.sampled_from(Event)), detail=draw(TEXT),
        reason=draw(TEXT), latched=draw(st.booleans()), q=draw(rows(n)),
        q_commanded=draw(rows(n)), ee_position=draw(row), ee_velocity=draw(row), path_position=draw(row),
        path_phase=draw(NAN_TOO), desired_velocity=draw(row), speed_scale=draw(NAN_TOO),
        range_distance=draw(rows(units)), obstacles=obstacles, force=draw(row), filtered_force=draw(row),
        thresholds=Thresholds(*draw(rows(6, 3))), armed=draw(st.booleans()), contact=draw(st.none() | contact),
        reaction_velocity=draw(row), restricted=draw(wholes(m)), approach_limit=draw(rows(m)), qp=qp,
        command=draw(rows(n)), residual=draw(rows(n)), evidence=draw(NAN_TOO), touched=draw(places()),
        detectable_n=draw(NAN_TOO),
    )  # fmt: skip


@st.composite
def places(draw: st.DrawFn) -> Touched:
    c = draw(st.integers(0, 2))
    return Touched(draw(wholes(c)), draw(rows(c, 3)), draw(rows(c, 3)), draw(rows(c)), draw(rows(c)))


@given(INPUTS, st.integers(-1, 2**62))
def test_inputs_come_back_to_the_bit_whatever_their_lengths(inputs, points_at):
    assert same(inputs_of(packed_inputs(inputs, points_at)), KeptInputs(inputs, points_at, ""))


@given(steps())
def test_a_step_comes_back_to_the_bit_in_arrays_as_fresh_ones(step):
    data = encode(step, 7)
    back = value_of(ControlStep, data)
    assert struct.unpack_from("<Q", data, 4)[0] == decoded(own("Step"), data).sequence == 7
    assert same(back, step)
    assert encode(back, 7) == data
    for array in (back.q, back.obstacles.point, back.obstacles.unit, back.thresholds.lower, back.command):
        assert array.flags.aligned
        assert array.flags.writeable
        assert array.flags.c_contiguous


@given(st.builds(Truth, rows(4), rows(4, 3), rows(3), rows(2), wholes(2), rows(2, 3)))
def test_truth_comes_back_to_the_bit(truth):
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


@pytest.fixture(scope="module")
def run(controller):
    run = Run(controller, seed=3)
    for _ in range(60):
        run.turn()
    return run


SPOILED = [
    lambda i: replace(i, robot=None),
    lambda i: replace(i, robot="broken"),
    lambda i: replace(i, readings=None),
    lambda i: replace(i, robot=replace(i.robot, q="seven numbers")),
    lambda i: replace(i, robot=replace(i.robot, q=[1.0, None])),
    lambda i: replace(i, robot=replace(i.robot, qd=np.zeros(7, complex))),
    lambda i: replace(i, readings=replace(i.readings, status=["OK"] * 7)),
    lambda i: replace(i, stamp=None),
    lambda i: replace(i, stamp=10**400),
    lambda i: replace(i, payload=0.7),
    lambda i: replace(i, robot=Hostile()),
    lambda i: None,
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


MIRRORED = {Obstacles: "Obstacles", Contact: "Contact", QpSolution: "QpSolution", Touched: "Touched",
            ControlStep: "Step", Truth: "Truth"}  # fmt: skip


@pytest.mark.parametrize("kind", MIRRORED)
def test_messages_mirror_the_types_field_by_field(kind):
    there = {name for name, _ in messages().store.fielddefs[own(MIRRORED[kind])][1]}
    assert there - {"sequence", "has_contact"} == {name for name, _ in hints_of(kind)}


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


@given(steps(), st.data())
def test_a_step_that_is_cut_or_changed_is_no_worse_than_a_recording_error(step, data):
    whole = bytearray(encode(step, 0))
    cut = data.draw(st.integers(0, len(whole)))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] = data.draw(st.integers(0, 255))
    for spoiled in (bytes(whole[:cut]), bytes(whole)):
        try:
            value_of(ControlStep, spoiled)
        except RecordingError:
            continue
