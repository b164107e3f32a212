"""Control steps and their inputs to messages and back."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from rosbags.typesys import get_types_from_msg

from pretouch.errors import RecordingError
from pretouch.modes import Event
from pretouch.recording.codec import (
    STEP,
    decode_inputs,
    decode_step,
    decode_truth,
    encode_inputs,
    encode_step,
    encode_truth,
)
from pretouch.recording.messages import OWN, PACKAGE, decoded, definition, fields_of, own_definition
from pretouch.recording.truth import Truth
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
    SeenPoints,
    Thresholds,
    Touched,
    TouchReadings,
)
from tests.fuzz.invariants import same
from tests.recording.oracle import typestore

NUMBER = st.floats(allow_nan=False)  # NaN with a payload is compared as NaN elsewhere
NAN_TOO = st.one_of(NUMBER, st.just(float("nan")))
TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)


def rows(*shape: int) -> st.SearchStrategy[np.ndarray]:
    return npst.arrays(np.float64, shape, elements=NAN_TOO)


def wholes(count: int) -> st.SearchStrategy[np.ndarray]:
    return npst.arrays(np.int64, count)


@st.composite
def robots(draw: st.DrawFn) -> RobotState:
    lengths = st.integers(0, 8)
    parts = [draw(rows(draw(lengths))) for _ in range(5)]
    return RobotState(draw(NAN_TOO), *parts, draw(st.none() | rows(6) | rows(0) | rows(7)))


@st.composite
def all_inputs(draw: st.DrawFn) -> Inputs:
    lengths = st.integers(0, 8)
    readings = RangeReadings(draw(rows(draw(lengths))), draw(rows(draw(lengths))), draw(wholes(draw(lengths))))
    return Inputs(draw(NAN_TOO), draw(robots()), readings, draw(st.booleans()))


@st.composite
def steps(draw: st.DrawFn) -> ControlStep:
    n, k, m, units = (draw(st.integers(0, 8)) for _ in range(4))
    row = rows(3)
    obstacles = Obstacles(
        draw(wholes(k)), draw(rows(k, 3)), draw(rows(k)), draw(rows(k, 3)), draw(wholes(k)), draw(rows(k, 3)),
        draw(rows(k)), draw(rows(k)),
    )  # fmt: skip
    contact = st.builds(Contact, row, npst.arrays(np.bool_, 3))
    qp = QpSolution(
        draw(rows(n)),
        draw(rows(m)),
        draw(rows(n + m)),
        draw(st.sampled_from(QpOutcome)),
        draw(TEXT),
        draw(st.booleans()),
    )
    return ControlStep(
        stamp=draw(NAN_TOO), mode=draw(st.sampled_from(Mode)), event=draw(st.sampled_from(Event)), detail=draw(TEXT),
        reason=draw(TEXT), latched=draw(st.booleans()), q=draw(rows(n)),
        q_commanded=draw(rows(n)), ee_position=draw(row), ee_velocity=draw(row), path_position=draw(row),
        path_phase=draw(NAN_TOO), desired_velocity=draw(row), speed_scale=draw(NAN_TOO),
        range_distance=draw(rows(units)), obstacles=obstacles, force=draw(row), filtered_force=draw(row),
        thresholds=Thresholds(draw(rows(6, 3))), armed=draw(st.booleans()), contact=draw(st.none() | contact),
        reaction_velocity=draw(row), restricted=draw(wholes(m)), approach_limit=draw(rows(m)), qp=qp,
        command=draw(rows(n)), residual=draw(rows(n)), evidence=draw(NAN_TOO), touched=draw(places()),
        detectable_n=draw(NAN_TOO),
    )  # fmt: skip


@st.composite
def places(draw: st.DrawFn) -> Touched:
    c = draw(st.integers(0, 2))
    return Touched(draw(wholes(c)), draw(rows(c, 3)), draw(rows(c, 3)), draw(rows(c)), draw(rows(c)))


@given(all_inputs(), st.integers(0, 2**63))
def test_inputs_come_back_to_the_bit_whatever_their_lengths(inputs, number):
    data, whole = encode_inputs(number, inputs)
    assert whole
    found, back, unreadable = decode_inputs(data)
    assert found == number
    assert unreadable == ""
    assert same(back, inputs)


@given(steps())
def test_a_step_comes_back_to_the_bit_in_arrays_as_fresh_ones(step):
    data = encode_step(7, step)
    number, back, tangent = decode_step(data)
    assert number == 7
    assert not len(tangent)
    assert same(back, step)
    for array in (back.q, back.obstacles.point, back.obstacles.unit, back.thresholds.parts, back.command):
        assert array.flags.aligned
        assert array.flags.writeable
        assert array.flags.c_contiguous


@given(rows(4), rows(4, 3), rows(3), st.lists(st.tuples(NAN_TOO, st.integers(-5, 99), rows(3)), max_size=3))
def test_truth_comes_back_to_the_bit(time, force, hand, touches):
    truth = Truth(time, force, hand, tuple(touches))
    number, back = decode_truth(encode_truth(3, truth))
    assert number == 3
    assert same(back, truth)


def some_step() -> ControlStep:
    """A step of an arm without joints that sees nothing."""
    none, no = np.zeros(0), np.zeros(0, np.int64)
    row, rows3 = np.zeros(3), np.zeros((0, 3))
    return ControlStep(
        0.0, Mode.HOLD, Event.CLEAR, "", "", False, none, none, row, row, row, 0.0, row, 1.0, none,
        Obstacles(no, rows3, none, rows3, no, rows3, none, none), row, row, Thresholds(np.zeros((6, 3))), False, None,
        row, no, none, QpSolution(none, none, none, QpOutcome.SKIPPED, ""), none, none, 0.0,
    )  # fmt: skip


def usual() -> Inputs:
    readings = RangeReadings(np.zeros(7), np.full(7, 0.5), np.zeros(7, np.int64))
    return Inputs(1.0, RobotState(1.0, *(np.zeros(7) for _ in range(5)), np.zeros(6)), readings)


class Hostile:
    """Something that fails however it is looked at."""

    def __repr__(self) -> str:
        raise RuntimeError("no")


@pytest.mark.parametrize(
    "spoil",
    [
        lambda i: replace(i, robot=None),
        lambda i: replace(i, robot="broken"),
        lambda i: replace(i, readings=None),
        lambda i: replace(i, robot=replace(i.robot, q=np.zeros((7, 1)))),
        lambda i: replace(i, robot=replace(i.robot, q="seven numbers")),
        lambda i: replace(i, robot=replace(i.robot, q=[1.0, None])),
        lambda i: replace(i, robot=replace(i.robot, wrench=3.0)),
        lambda i: replace(i, robot=replace(i.robot, qd=np.zeros(7, complex))),
        lambda i: replace(i, readings=replace(i.readings, status=np.zeros(7))),
        lambda i: replace(i, readings=replace(i.readings, status=["OK"] * 7)),
        lambda i: replace(i, stamp=None),
        lambda i: replace(i, stamp=10**13),
        lambda i: replace(i, stamp=10**400),
        lambda i: replace(i, robot=Hostile()),
        lambda i: None,
        lambda i: Hostile(),
        lambda i: replace(i, robot=SimpleNamespace(q="\ud800\0" * 1000)),
    ],
)
def test_inputs_that_fit_no_message_are_marked_as_such(spoil):
    data, whole = encode_inputs(5, spoil(usual()))
    number, back, unreadable = decode_inputs(data)
    assert not whole
    assert number == 5
    assert back is None
    assert 0 < len(unreadable) < 5000


@pytest.mark.parametrize(
    ("spoil", "wanted"),
    [
        (lambda i: replace(i, stamp=1), lambda i: i),
        (lambda i: replace(i, stamp=np.float32(1.0)), lambda i: i),
        (lambda i: replace(i, robot=replace(i.robot, q=[0] * 7)), lambda i: i),
        (lambda i: replace(i, robot=replace(i.robot, q=np.zeros(14)[::2])), lambda i: i),
        (lambda i: replace(i, readings=replace(i.readings, status=np.zeros(7, np.uint8))), lambda i: i),
        (lambda i: replace(i, robot=replace(i.robot, tau_ext="none")),
         lambda i: replace(i, robot=replace(i.robot, tau_ext=np.zeros(0)))),
    ],
)  # fmt: skip
def test_inputs_of_other_types_are_kept_as_the_controller_takes_them(spoil, wanted):
    data, whole = encode_inputs(5, spoil(usual()))
    assert whole
    assert same(decode_inputs(data)[1], wanted(usual()))


def test_messages_mirror_the_types_field_by_field():
    mirrored = (RobotState, RangeReadings, Obstacles, Contact, QpSolution, Touched, ControlStep, Inputs)
    own = {"sequence", "time", "unreadable", "has_wrench", "has_contact", "path_tangent"}
    beside = {
        "touch",
        "points",
        "payload",
        "desired",
        "moving",
    }  # of Inputs: in messages of their own, of steps that have them
    for kind in mirrored:
        name = {"ControlStep": "Step"}.get(kind.__name__, kind.__name__)
        there = {field.name for field in fields_of(f"{PACKAGE}/msg/{name}")}
        assert there - own == {f.name for f in fields(kind)} - beside
    touch = {field.name for field in fields_of(f"{PACKAGE}/msg/Touch")}
    assert touch - {"sequence", "step_stamp"} == {f.name for f in fields(TouchReadings)}
    points = {field.name for field in fields_of(f"{PACKAGE}/msg/SeenPoints")}
    assert points - own == {f.name for f in fields(SeenPoints)} | {"same_as"}


def test_the_rows_of_the_thresholds_have_their_names():
    step = replace(decode_step(encode_step(0, some_step()))[1], thresholds=Thresholds(np.arange(18.0).reshape(6, 3)))
    message = decoded(STEP, encode_step(0, step)).thresholds
    for name, *_ in fields_of(f"{PACKAGE}/msg/Thresholds"):
        assert getattr(message, name).tobytes() == getattr(step.thresholds, name).tobytes()


@pytest.mark.parametrize("name", OWN)
def test_each_field_of_a_message_file_is_explained(name):
    lines = [line for line in own_definition(name).splitlines() if line]
    assert lines[0].startswith("#")
    assert all("#" in line for line in lines if line.split()[0] not in OWN)
    assert all(len(line) <= 120 for line in lines)


@pytest.mark.parametrize("name", OWN)
def test_the_definition_that_is_embedded_can_be_parsed_alone(name):

    kind = f"{PACKAGE}/msg/{name}"
    for found, fields_ in get_types_from_msg(definition(kind), kind).items():
        assert fields_ == typestore().fielddefs[found]


@given(steps(), st.data())
def test_a_step_that_is_cut_or_changed_is_no_worse_than_a_recording_error(step, data):
    whole = bytearray(encode_step(0, step))
    cut = data.draw(st.integers(0, len(whole)))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] = data.draw(st.integers(0, 255))
    for spoiled in (bytes(whole[:cut]), bytes(whole)):
        try:
            decode_step(spoiled)
        except RecordingError:
            continue


def test_a_message_of_nothing_is_a_recording_error():
    with pytest.raises(RecordingError, match="cannot be read"):
        decoded(STEP, b"")
