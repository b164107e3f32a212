"""The sequential detector in the controller: absent torques, and a change of method."""

from dataclasses import replace

import numpy as np
import pytest
from tests.following_arm import Arm

from pretouch.profiles import profile
from pretouch.types import Mode


@pytest.mark.parametrize("given", [None, "many", np.full(7, np.nan), np.zeros(3), np.full(7, 1e9)])
@pytest.mark.parametrize(("name", "holds"), [("pretouch", True), ("paper", False)])
def test_an_arm_without_torques_holds_if_its_detector_needs_them(panda_model, paper_skin, given, name, holds):
    arm = Arm(panda_model, paper_skin, profile(f"{name}:window.samples=10"))
    step = arm.run(40, change=lambda robot: replace(robot, tau_ext=given))[-1]
    assert (step.mode is Mode.HOLD) is holds
    assert np.isnan(step.residual).all()
    assert ("force" in step.reason) is holds


def test_another_method_begins_anew_and_what_was_learnt_can_be_given(panda_model, paper_skin):
    paper, ours = (Arm(panda_model, paper_skin, profile(name)) for name in ("paper", "pretouch"))
    assert paper.step().evidence == 0.0
    model = ours.controller.adopt(paper.state, paper.controller).learnt
    assert not model.weights.any()
    known = model._replace(weights=model.weights + 0.5)
    again = ours.controller.init(ours.robot(), known).learnt
    np.testing.assert_array_equal(again.weights, 0.5)
