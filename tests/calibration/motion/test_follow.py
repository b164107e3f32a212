"""An arm follows a plan under its controller, and what is not as planned ends the motion, at rest."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch import loop
from pretouch.calibration.motion.follow import PlanCommander, plan_controller
from pretouch.calibration.motion.plan import Plan
from pretouch.ports import NoUnits
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.types import RobotState
from tests.calibrated_arm import swinging

DURATION_S = 8.0


def arm_at(model: RobotModel, q: np.ndarray) -> Plant:
    plant = Plant(model, SceneSpec(), PlantParams(), q, 0)
    plant.advance(0.2)
    return plant


def followed(plant: Plant, model: RobotModel, plan: Plan) -> tuple[PlanCommander, list[loop.Cycle]]:
    controller, cycles = plan_controller(model, plan.start), []
    commander = PlanCommander(controller, plan, lambda: plant.time)
    record, options = SimpleNamespace(record=cycles.append), loop.Options(desired=commander)
    loop.run(controller, plant, NoUnits(), PlantClock(plant, 0.01), record, commander.done, options)
    return commander, cycles


def test_the_simulated_arm_follows_within_two_milliradians_and_ends_at_rest(panda_model: RobotModel):
    plan = swinging(panda_model, DURATION_S)
    plant = arm_at(panda_model, plan.start)
    commander, kept = followed(plant, panda_model, plan)
    assert commander.stopped == ""
    assert commander.begin is not None
    states = [cycle.inputs.robot for cycle in kept]
    off = [s.q - plan.at(s.stamp - commander.begin)[0] for s in states if s.stamp >= commander.begin]
    assert len(off) == pytest.approx(DURATION_S / 0.01, abs=3)
    assert np.abs(off).max() < 2e-3
    assert np.ptp([s.q for s in states], axis=0).min() > 0.1
    plant.advance(0.3)
    np.testing.assert_allclose(plant.read().q, plan.postures[-1], atol=2e-3)
    steps = np.diff([cycle.step.command for cycle in kept], axis=0) / 0.01
    assert np.all(np.abs(steps) <= 1.001 * panda_model.description.qdd_max)


def test_time_that_a_simulation_leaves_out_is_none_of_the_plans(panda_model: RobotModel):
    plan = swinging(panda_model, DURATION_S)
    plant = arm_at(panda_model, plan.start)

    class SlowMachine:
        """Does not simulate for 0.15 s where the arm moves fast, while the controller and the stamps go on."""

        def __init__(self) -> None:
            self.now = plant.time

        @property
        def left_out(self) -> float:
            return self.now - plant.time

        def tick(self) -> float:
            self.now += 0.01
            if not 5.0 < self.now < 5.15:
                plant.advance(0.01)
            return self.now

        def read(self) -> RobotState:
            return replace(plant.read(), stamp=self.now)

        def command(self, qd: np.ndarray) -> None:
            plant.command(qd)

    machine, controller = SlowMachine(), plan_controller(panda_model, plan.start)
    commander = PlanCommander(controller, plan, lambda: machine.now, lambda: machine.left_out)
    kept: list[loop.Cycle] = []
    record, options = SimpleNamespace(record=kept.append), loop.Options(desired=commander)
    loop.run(controller, machine, NoUnits(), machine, record, commander.done, options)
    assert commander.stopped == ""
    speeds = [np.abs(cycle.step.command).max() for cycle in kept if 4.9 < cycle.inputs.robot.stamp < 5.2]
    assert max(speeds) > 0.5
    assert kept[-1].step.q == pytest.approx(plan.postures[-1], abs=5e-3)


def test_a_push_ends_the_motion_at_rest(panda_model: RobotModel):
    plan = swinging(panda_model, DURATION_S)
    plant, hand = arm_at(panda_model, plan.start), panda_model.link_index("panda_hand")

    def push(time: float) -> None:
        plant.mj_data.xfrc_applied[hand, :3] = [0.0, 40.0, 0.0] if time > 3.5 else 0.0

    plant.before_each_step(push)
    commander, kept = followed(plant, panda_model, plan)
    assert commander.stopped == kept[-1].step.reason
    assert kept[-1].step.contact is not None
    assert 3.5 < plant.time < 5.0
    plant.mj_data.xfrc_applied[:] = 0.0
    plant.advance(0.5)
    assert np.abs(plant.read().qd).max() < 0.02


def test_an_arm_that_is_elsewhere_does_not_begin(panda_model: RobotModel):
    plan = swinging(panda_model, DURATION_S)
    plant = arm_at(panda_model, plan.start + 0.05)
    commander, kept = followed(plant, panda_model, plan)
    assert commander.stopped.startswith("The arm is not where the plan begins: panda_joint")
    assert not any(cycle.step.command.any() for cycle in kept[:-1])


def test_an_arm_that_does_not_follow_ends_the_motion_by_the_name_of_the_joint(panda_model: RobotModel):
    plan = Plan(
        np.array([0.0, 1.0]), np.array([panda_model.description.q_ready, panda_model.description.q_ready + 1.5])
    )
    commander, _ = followed(arm_at(panda_model, plan.start), panda_model, plan)  # faster than its limits
    assert commander.stopped.startswith("The arm has left the plan: panda_joint")


def test_an_arm_whose_force_is_not_known_does_not_begin(panda_model: RobotModel, monkeypatch: pytest.MonkeyPatch):
    plan = swinging(panda_model, DURATION_S)
    plant = arm_at(panda_model, plan.start)
    read = plant.read

    monkeypatch.setattr(plant, "read", lambda: replace(read(), wrench=None))
    commander, kept = followed(plant, panda_model, plan)
    assert commander.begin is None
    assert "force" in commander.stopped
    assert kept[-1].step.stamp - kept[0].step.stamp == pytest.approx(5.0, abs=0.05)
