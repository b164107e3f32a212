"""The sequential detector in the controller: absent torques, and a change of method."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.path import line
from pretouch.controller import Controller
from pretouch.profiles import profile
from pretouch.sensing.skin import Skin
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.types import Inputs, Mode, RangeReadings, RobotState

NONE = RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def controller(model, name: str) -> Controller:
    x = model.kinematics(model.description.q_ready).position[model.ee]
    way = line(tuple(x.tolist()), (float(x[0]), float(x[1]) + 0.1, float(x[2])))
    return Controller(model, Skin([], model), fixtures(SceneSpec()), way, profile(name))


def robot(model, stamp: float, tau_ext: object) -> RobotState:
    q, still = model.description.q_ready, np.zeros(model.n)
    return RobotState(stamp, q, still, q, still, tau_ext, np.zeros(6))  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [None, "many", np.full(7, np.nan), np.zeros(3), np.full(7, 1e9)])
@pytest.mark.parametrize(("name", "holds"), [("pretouch", True), ("paper", False)])
def test_an_arm_without_torques_holds_if_its_detector_needs_them(panda_model, given, name, holds):
    c = controller(panda_model, f"{name}:window.samples=10")
    state = c.init(robot(panda_model, 0.0, given))
    for k in range(1, 40):
        step, state = c.step(state, Inputs(0.01 * k, robot(panda_model, 0.01 * k, given), NONE))
    assert (step.mode is Mode.HOLD) is holds
    assert np.isnan(step.residual).all()
    assert ("force" in step.reason) is holds


def test_another_method_begins_anew_and_what_was_learnt_can_be_given(panda_model):
    paper, ours = controller(panda_model, "paper"), controller(panda_model, "pretouch")
    state = paper.init(robot(panda_model, 0.0, np.zeros(7)))
    step, state = paper.step(state, Inputs(0.01, robot(panda_model, 0.01, np.zeros(7)), NONE))
    assert step.evidence == 0.0
    adopted = ours.adopt(state, paper)
    model = adopted.detector.test.model
    assert not model.weights.any()
    known = replace(model, weights=model.weights + 0.5)
    again = ours.init(robot(panda_model, 0.0, np.zeros(7)), known).detector.test.model
    np.testing.assert_array_equal(again.weights, 0.5)
