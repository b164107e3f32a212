"""A program's own loop with a shield between its commander and its arm, on the simulated arm."""

from dataclasses import replace

import numpy as np
import pytest

import pretouch as pt
from pretouch.desired import joint_velocities, twist
from pretouch.errors import RobotStateError

START = np.array([0.45, -0.2, 0.5])


@pytest.fixture
def plant(panda_model: pt.RobotModel) -> pt.Plant:
    return pt.Plant(panda_model, pt.SceneSpec(), pt.PlantParams(), pt.brought_to(panda_model, START), seed=1)


@pytest.fixture
def shield(panda_model: pt.RobotModel, plant: pt.Plant) -> pt.Shield:
    return pt.shield(panda_model, pt.Skin([], panda_model), plant.read(), "blind")


def turned(shield: pt.Shield, plant: pt.Plant, until: float, ask: object) -> list[pt.ControlStep]:
    """Steps of a loop in which `ask(now)` says what is wanted."""
    clock, steps = pt.PlantClock(plant, shield.controller.limits.period), []
    none = pt.RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
    while (now := clock.tick()) < until:
        steps.append(shield(pt.Inputs(now, plant.read(), none, desired=ask(now))))  # type: ignore[operator]
        plant.command(steps[-1].command)
    return steps


def test_what_is_asked_is_done_and_where_nothing_is_asked_the_hand_stays(shield, plant):
    steps = turned(shield, plant, 4.0, lambda now: twist(now, (0.0, 0.1, 0.0)) if 2.0 <= now < 3.0 else None)
    y = np.array([step.ee_position[1] for step in steps])
    at = [step.stamp for step in steps]
    asked = int(np.searchsorted(at, 2.0)), int(np.searchsorted(at, 3.0))
    assert np.ptp(y[: asked[0]]) < 2e-3
    assert y[asked[1]] - y[asked[0]] == pytest.approx(0.1, abs=0.01)
    assert np.ptp(y[asked[1] + 20 :]) < 2e-3
    assert {step.mode for step in steps[asked[0] :]} == {pt.Mode.TRACK}


def test_a_turn_recomputes_and_a_false_report_is_not_believed(shield, plant):
    turned(shield, plant, 1.5, lambda now: joint_velocities(now, np.zeros(7)))
    cycle = shield.cycle
    step, _ = shield.controller.step(cycle.before, cycle.inputs)
    np.testing.assert_array_equal(step.command, cycle.step.command)
    lie = replace(plant.read(), qd_commanded=np.full(7, 1.0))  # 0 was sent
    step = shield(replace(cycle.inputs, stamp=cycle.inputs.stamp + 0.01, robot=lie))
    assert step.mode is pt.Mode.HOLD
    assert np.abs(step.command).max() < 0.1


def test_a_shield_begins_with_a_state_that_can_be_used(panda_model, plant):
    broken = replace(plant.read(), qd=np.full(7, np.nan))
    with pytest.raises(RobotStateError, match="cannot start"):
        pt.shield(panda_model, pt.Skin([], panda_model), broken, "blind")


def test_a_program_may_read_the_arm_after_the_clock(shield, plant):
    turned(shield, plant, 1.5, lambda now: None)
    last = shield.cycle.inputs
    robot = replace(plant.read(), stamp=last.stamp + 0.012)
    step = shield(replace(last, stamp=last.stamp + 0.01, robot=robot, desired=None))
    assert step.mode is pt.Mode.TRACK
    assert step.stamp == robot.stamp
