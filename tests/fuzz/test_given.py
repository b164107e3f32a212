"""What a caller may hand over: arrays of other types and layouts, buffers used again, shapes that are wrong."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import fields, replace
from sys import modules

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from pretouch.contact.window import Window
from pretouch.controller import ControllerState
from pretouch.errors import PretouchError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Inputs, Mode, RangeReadings, RangeStatus, RobotState
from tests.following_arm import SHORT, Arm
from tests.fuzz.invariants import arrays_of, same

NUMBERS = ["q", "qd", "q_commanded", "qd_commanded", "wrench", "stamp", "distance"]


class Moving(Arm):
    """An arm on its way, and the inputs of its next step."""

    def __init__(self, model: RobotModel, skin: Skin) -> None:
        super().__init__(model, skin, SHORT)
        felt, seen = (0.5, 0.5, 0.5), dict.fromkeys(range(7), 0.5)
        self.last = self.run(30, force=felt, seen=seen)[-1]
        self.next = Inputs(self.time, self.robot(felt), self.readings(seen))

    def given(self, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        return self.controller.step(self.state, inputs)


@pytest.fixture(scope="module")
def moving(panda_model, paper_skin) -> Moving:
    return Moving(panda_model, paper_skin)


def changed(inputs: Inputs, change: Callable[[np.ndarray], object], names: list[str]) -> Inputs:
    """The same inputs with some arrays handed over in another way."""

    def part(value: RobotState | RangeReadings) -> RobotState | RangeReadings:
        there = [
            f.name for f in fields(value) if f.name in names and f.name + type(value).__name__ != "stampRobotState"
        ]
        return replace(value, **{name: change(getattr(value, name)) for name in there})

    return replace(inputs, robot=part(inputs.robot), readings=part(inputs.readings))


def read_only(a: np.ndarray) -> np.ndarray:
    a = a.copy()
    a.flags.writeable = False
    return a


def compiled_versions() -> int:
    """How many versions of compiled functions there are by now."""
    ours = [m for name, m in list(modules.items()) if name.startswith("pretouch")]
    functions = {id(f): f for m in ours for f in vars(m).values() if isinstance(f, CPUDispatcher)}
    return sum(len(f.signatures) for f in functions.values())


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (read_only, [*NUMBERS, "status"]),
        (lambda a: np.repeat(a, 2)[::2], [*NUMBERS, "status"]),
        (lambda a: a[::-1].copy()[::-1], [*NUMBERS, "status"]),
        (lambda a: a.astype(">f8"), NUMBERS),
        (lambda a: a.astype(np.longdouble), NUMBERS),
        (lambda a: a.tolist(), [*NUMBERS, "status"]),
        (tuple, [*NUMBERS, "status"]),
        (lambda a: a.astype(np.int8), ["status"]),
        (lambda a: a.astype(np.int32), ["status"]),
        (lambda a: a.astype(np.uint8), ["status"]),
        (lambda a: [RangeStatus(int(s)) for s in a], ["status"]),
    ],
)
def test_another_type_or_layout_gives_the_same_and_compiles_nothing(moving: Moving, change, names):
    expected = moving.given(moving.next)
    before = compiled_versions()
    answer = moving.given(changed(moving.next, change, names))
    # the numbers are the same, and what is published is in float64 of its own
    assert same(answer[0], expected[0])
    assert compiled_versions() == before >= 3  # perception, thresholds, motion


def test_whole_and_short_numbers_are_numbers(moving: Moving):
    before = compiled_versions()
    for kind in (np.float32, np.float16, np.int64, bool):
        step, _ = moving.given(changed(moving.next, lambda a, kind=kind: a.astype(kind), NUMBERS))
        assert np.isfinite(step.command).all()
        assert {a.dtype for _, a in arrays_of(step)} <= {np.dtype(t) for t in (np.float64, np.int64, np.bool_)}
    assert compiled_versions() == before


def test_a_driver_may_use_its_buffers_again(moving: Moving):
    inputs = deepcopy(moving.next)
    step, state = moving.given(inputs)
    kept = deepcopy((step, state))
    for name, array in arrays_of(inputs.robot) + arrays_of(inputs.readings):
        if name != "tau_ext":
            array[:] = 99
    assert same(step, kept[0])
    assert same(state, kept[1])
    assert same(moving.given(moving.next)[0], kept[0])


def test_a_window_that_fills_keeps_no_buffer(panda_model, paper_skin):
    moving = Moving(panda_model, paper_skin)
    state = moving.controller.init(moving.next.robot)
    inputs = deepcopy(moving.next)
    step, state = moving.controller.step(state, inputs)
    inputs.robot.wrench[:] = 99.0
    np.testing.assert_array_equal(step.filtered_force, 0.5)
    np.testing.assert_array_equal(state.memory.part("window", Window).newest, 0.5)
    robot = deepcopy(moving.next.robot)
    state = moving.controller.init(robot)
    robot.qd_commanded[:] = 99.0
    np.testing.assert_array_equal(state.memory.get("command"), moving.next.robot.qd_commanded)


WRONG = [
    lambda a: a[:0], lambda a: a[:1], lambda a: a[:-1], lambda a: np.append(a, a[-1]), lambda a: a[:, None],
    lambda a: a[None], lambda a: np.tile(a, 1000), lambda a: a[0],
    *(lambda a, wrong=wrong: wrong for wrong in ("far", ["far"] * 7, [[1.0], [2.0, 3.0]], [10**400] * 7, [1j] * 7)),
]  # fmt: skip
ROBOT, READINGS = ("q", "qd", "q_commanded", "qd_commanded", "wrench"), ("stamp", "distance", "status")


def assert_held(moving: Moving, step: ControlStep) -> None:
    """A HOLD, the arm braking from where it was."""
    assert step.mode is Mode.HOLD
    assert np.linalg.norm(step.command) < np.linalg.norm(moving.last.command)
    assert step.range_distance.shape == (7,)


@pytest.mark.parametrize("change", WRONG)
@pytest.mark.parametrize("parts", [*([part] for part in (*ROBOT, *READINGS)), READINGS])
def test_another_shape_and_what_is_no_array_of_numbers_are_refused(moving: Moving, parts: list[str], change):
    inputs, of_arm = changed(moving.next, change, parts), parts[0] in ROBOT
    step, state = moving.given(inputs)
    assert_held(moving, step)
    assert state.mode.latched is of_arm
    wrong = getattr(inputs.robot if of_arm else inputs.readings, parts[0])
    assert not isinstance(wrong, np.ndarray | np.generic) or str(wrong.shape) in step.reason
    if of_arm:
        with pytest.raises(PretouchError, match=parts[0]):
            moving.controller.init(inputs.robot)


@pytest.mark.parametrize("status", [None, np.full(7, 0.5), np.full(7, np.nan), np.array([RangeStatus.OK] * 7, object)])
def test_statuses_that_are_no_whole_numbers_are_refused(moving: Moving, status: np.ndarray | None):
    step, _ = moving.given(changed(moving.next, lambda a: status, ["status"]))
    assert_held(moving, step)
    assert "status" in step.reason
