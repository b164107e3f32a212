"""The checks of the fuzz notice what they are there for."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.robot.description import fr3
from pretouch.types import ControlStep, Inputs, Mode, QpOutcome, RangeReadings, RangeStatus
from tests.fuzz import invariants
from tests.fuzz.machine import Course, Machine
from tests.fuzz.oracle import Expected, Oracle
from tests.fuzz.worlds import World

PAPER = PROFILES["paper"]
SHORT = replace(PAPER, window=replace(PAPER.window, samples=5))


@pytest.fixture
def course(panda_model, paper_skin) -> Course:
    """An arm on the move, an obstacle near its hand."""
    world = World(
        panda_model,
        SHORT,
        paper_skin,
        no_fixtures(),
        Circle(),
        panda_model.description.q_ready,
        np.zeros(7),
        False,
        0.0,
    )
    course = Course(Machine(0), world)
    course.weather.feel = "denormal"
    for _ in range(30):
        course.step(honest(course), deep=False)
    return course


def honest(course: Course) -> Inputs:
    k = len(course.world.skin)
    seen = np.full(k, int(RangeStatus.OK))
    return Inputs(course.time, course.robot(), RangeReadings(np.full(k, course.time), np.full(k, 0.25), seen))


def stepped(course: Course) -> tuple[ControlStep, Expected]:
    inputs = honest(course)
    step, course.state = course.controller.step(course.state, inputs)
    assert step.qp.outcome is QpOutcome.SOLVED
    assert len(step.restricted) > 2
    return step, course.oracle.expect(inputs)


def test_a_command_beyond_a_limit_is_noticed(course: Course):
    step, e = stepped(course)
    model = course.world.model
    invariants.check_command(step, e, SHORT, model)
    reach = model.description.qdd_max * 0.01
    with pytest.raises(AssertionError, match="acceleration"):
        invariants.check_command(replace(step, command=e.qd + 1.001 * reach), e, SHORT, model)
    fast = replace(e, qd=model.description.qd_max - 1e-3)
    with pytest.raises(AssertionError, match="velocity"):
        invariants.check_command(replace(step, command=fast.qd + 2e-3), fast, SHORT, model)
    # at 0.5 rad/s a joint of 7.5 rad/s^2 needs 17 mrad to stand
    close = replace(e, q=model.q_max - 0.01 - 0.015, qd=np.full(7, 0.5))
    with pytest.raises(AssertionError, match="position"):
        invariants.check_command(replace(step, command=close.qd), close, SHORT, model)
    with pytest.raises(AssertionError):
        invariants.check_command(replace(step, command=step.command * np.nan), e, SHORT, model)


def test_a_speed_beyond_an_envelope_is_noticed():
    arm = fr3()
    reach, e = arm.qdd_max * 0.01, arm.envelope
    # 0.3 rad before the end of the upper side and of the lower one
    place = np.stack((e.q_upper, -e.q_lower)) - 0.3
    most = np.sqrt(e.slope * 0.3) - e.offset
    assert invariants.below_envelope(np.stack((0.5 * most, 0.5 * most)), place, reach, 0.01, e).all()
    for side in range(2):
        speed = np.zeros((2, 7))
        speed[side] = most + 1e-3
        below = invariants.below_envelope(speed, place, reach, 0.01, e)
        assert not below[side].any()
        assert below[1 - side].all()
    # where braking is weaker than the envelope is steep, what is below it now may not stay there
    steep = e.slope / 2 > arm.qdd_max
    assert steep.any()
    speed = np.stack((most - 1e-3, np.zeros(7)))
    assert not invariants.below_envelope(speed, place, reach, 0.01, e)[0, steep].any()


def test_a_slack_that_is_not_true_is_noticed(course: Course):
    step, _ = stepped(course)
    model = course.other
    invariants.check_rows(step, SHORT, model)
    tampered = [
        replace(step, qp=replace(step.qp, slack=step.qp.slack + 2e-7)),
        replace(step, command=step.command + 1e-3),
        replace(step, approach_limit=step.approach_limit + 1e-6),
        replace(step, restricted=step.restricted[1:]),
        replace(step, obstacles=replace(step.obstacles, link=np.maximum(step.obstacles.link - 1, 1))),
    ]
    for wrong in tampered:
        with pytest.raises(AssertionError):
            invariants.check_rows(wrong, SHORT, model)


def test_a_factor_that_is_not_kept_is_noticed(course: Course):
    step, _ = stepped(course)
    invariants.check_speed_scale(step, SHORT)
    faster = step.desired_velocity * 2.0 / step.speed_scale
    for wrong in (replace(step, speed_scale=1.0), replace(step, desired_velocity=faster)):
        with pytest.raises(AssertionError):
            invariants.check_speed_scale(wrong, SHORT)


def test_numbers_shapes_and_types_that_are_wrong_are_noticed(course: Course):
    step, e = stepped(course)
    invariants.check_finite(step, e, SHORT)
    invariants.check_shapes(step, 7, 7)
    for wrong in (replace(step, ee_velocity=step.ee_velocity * np.inf), replace(step, speed_scale=1.5)):
        with pytest.raises(AssertionError):
            invariants.check_finite(wrong, e, SHORT)
    for wrong in (replace(step, q=step.q[:6]), replace(step, command=step.command.astype(np.float32))):
        with pytest.raises(AssertionError):
            invariants.check_shapes(wrong, 7, 7)


def test_the_wrong_mode_or_sentence_is_noticed(course: Course):
    step, e = stepped(course)
    state = course.oracle.__dict__.copy()

    def told(wrong: ControlStep, **expected: object) -> str:
        oracle = Oracle.__new__(Oracle)
        oracle.__dict__.update(state)
        return invariants.check_mode(wrong, replace(e, **expected), oracle, resume=False, latched=False)

    assert told(step) == "clear"
    with pytest.raises(AssertionError):
        told(replace(step, mode=Mode.HOLD))
    with pytest.raises(AssertionError):
        told(replace(step, reason="The force window is filling."))
    with pytest.raises(AssertionError):
        told(step, silent=["hand_left"])
    with pytest.raises(AssertionError):
        told(step, fault="stale")


def test_braking_that_is_none_is_noticed(course: Course):
    step, e = stepped(course)
    held = replace(step, qp=replace(step.qp, outcome=QpOutcome.SKIPPED))
    for command in (1.01 * e.qd, -0.01 * e.qd, 0.999 * e.qd):
        with pytest.raises(AssertionError):
            invariants.check_braking(replace(held, command=command), e, SHORT, course.world.model)


def test_a_difference_in_the_last_bit_is_noticed(course: Course):
    step, _ = stepped(course)
    assert invariants.same(step, replace(step, command=step.command.copy()))
    assert not invariants.same(step, replace(step, command=np.nextafter(step.command, 9.0)))
    assert not invariants.same(step, replace(step, reason="another"))
