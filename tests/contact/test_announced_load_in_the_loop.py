"""Announced loads of a simulated arm in motion: none gives an alarm, and a push is one all the same."""

from dataclasses import replace

import pytest

from pretouch.control.path import Circle
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.loop import Options, run
from pretouch.payload import Payload
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.types import ControlStep, Mode

GRIPPED, PUT_DOWN = 25.0, 28.0


def steps_of(
    model: RobotModel, seed: int, kg: float, early: float | None, end: float = 30.5, push: float = 0.0
) -> list[ControlStep]:
    """An arm grips so much, announced so much earlier and 5 % wrong, is pushed 1 s later, and puts it down."""
    arm = Plant(
        model, SceneSpec(), replace(PlantParams(), payload_kg=0.05), brought_to(model, Circle().point(0.0)), seed
    )
    hand, steps, off = int(arm.mj_model.body(model.description.ee_body).id), [], 1.0 + 0.05 * (-1) ** seed

    def before_step(time: float) -> None:
        arm.grip(kg if GRIPPED <= time < PUT_DOWN else 0.0)
        arm.mj_data.xfrc_applied[hand, 1] = push if GRIPPED + 1.0 <= time < GRIPPED + 1.3 else 0.0

    def said() -> Payload | None:
        if early is None or arm.time < GRIPPED - early:
            return None
        return Payload(kg * off if arm.time < PUT_DOWN - early else 0.0)

    class Recorder:
        def record(self, cycle) -> None:
            steps.append(cycle.step)

    arm.before_each_step(before_step)
    controller = Controller(model, paper_skin(model), fixtures(SceneSpec()), Circle(), profile("pretouch"))
    units, clock = RangeFinders(arm, controller.skin, RangeFinderParams(), seed), PlantClock(arm, 0.01)
    arm.advance(0.2)
    run(controller, arm, units, clock, Recorder(), lambda step: step.stamp >= end, Options(payload=said))
    return steps


def alarms(steps: list[ControlStep]) -> list[float]:
    return [step.stamp for step in steps if step.contact is not None]


@pytest.mark.slow
@pytest.mark.parametrize("early", [0.0, 0.25])
@pytest.mark.parametrize("seed", [100, 101])
def test_a_load_that_was_announced_gives_no_alarm(panda_model, seed, early):
    assert not alarms(steps_of(panda_model, seed, 0.7, early))


@pytest.mark.slow
def test_one_of_three_kilograms_gives_none_either(panda_model):
    assert not alarms(steps_of(panda_model, 103, 3.0, 0.1))


@pytest.mark.slow
def test_one_that_was_not_gives_one(panda_model):
    assert GRIPPED < alarms(steps_of(panda_model, 100, 0.7, None, 26.0))[0] < GRIPPED + 0.2


@pytest.mark.slow
def test_announced_too_late_it_gives_one_and_the_arm_goes_on_soon(panda_model):
    steps = steps_of(panda_model, 100, 0.7, -0.25, PUT_DOWN)
    (at,) = alarms(steps)
    assert next(step.stamp for step in steps if step.stamp > at and step.mode is Mode.TRACK) - at < 3.0


@pytest.mark.slow
def test_a_push_soon_after_is_found(panda_model):
    found = alarms(steps_of(panda_model, 100, 0.7, 0.1, GRIPPED + 1.5, push=15.0))
    assert len(found) == 1
    assert 0.0 < found[0] - GRIPPED - 1.0 < 0.15
