"""Another profile or path while the arm moves: one controller goes on from the state of another."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.path import Circle, Path
from pretouch.controller import Controller
from pretouch.errors import RobotStateError
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Mode
from tests.following_arm import DT, PAPER, Arm, on_its_way

PUSH = (0.0, 40.0, 0.0)


@pytest.fixture
def arm(panda_model: RobotModel, paper_skin: Skin) -> Arm:
    """An arm under the paper's profile, on its way along a line at full speed."""
    return on_its_way(panda_model, paper_skin)


def switch(arm: Arm, profile: Profile | None = None, path: Path | None = None) -> None:
    """Give the arm another controller while it moves."""
    before = arm.controller
    arm.controller = Controller(
        before.model, before.skin, before.fixtures, path or before.path, profile or before.profile
    )
    arm.state = arm.controller.adopt(arm.state, before)


def test_an_equal_controller_goes_on_as_if_nothing_had_been(arm: Arm, panda_model: RobotModel, paper_skin: Skin):
    other = on_its_way(panda_model, paper_skin)
    switch(arm, replace(PAPER))
    for mine, theirs in zip(arm.run(50, seen={0: 0.3}), other.run(50, seen={0: 0.3}), strict=True):
        np.testing.assert_array_equal(mine.command, theirs.command)
        assert mine.reason == theirs.reason


def test_another_profile_of_the_same_window_does_not_stop_the_arm(arm: Arm):
    switch(arm, PROFILES["blind"])
    before = arm.qd
    steps = arm.run(20, seen={0: 0.2})
    assert {s.mode for s in steps} == {Mode.TRACK}
    assert {s.speed_scale for s in steps} == {1.0}
    assert np.abs(steps[0].command - before).max() < 0.02  # rad/s, as from step to step on a line


def test_units_that_were_not_looked_at_are_not_taken_for_silent(arm: Arm):
    switch(arm, PROFILES["blind"])
    arm.run(100)
    switch(arm, PAPER)
    assert {s.mode for s in arm.run(10)} == {Mode.TRACK}


def test_a_window_of_another_length_is_filled_before_anything_is_felt(arm: Arm):
    switch(arm, replace(PAPER, window=replace(PAPER.window, samples=50)))
    steps = arm.run(52)
    assert {s.mode for s in steps[:50]} == {Mode.HOLD}
    assert "of 50 samples" in steps[10].reason
    assert steps[51].mode is Mode.TRACK


def test_a_reaction_under_way_goes_on_and_decays(arm: Arm):
    arm.run(6, force=PUSH)
    begun = arm.run(20)[-1]
    assert begun.mode is Mode.REACT
    switch(arm, replace(PAPER, task=replace(PAPER.task, speed_m_s=0.2)))
    steps = arm.run(300)
    assert steps[0].mode is Mode.REACT
    size = [float(np.linalg.norm(s.reaction_velocity)) for s in (begun, *steps)]
    assert size[1] == pytest.approx(size[0] - 0.3 / 200)
    assert steps[-1].mode is Mode.TRACK


def test_a_longer_decay_does_not_bring_a_past_reaction_back(arm: Arm):
    arm.run(6, force=PUSH)
    arm.run(250)
    switch(arm, replace(PAPER, react=replace(PAPER.react, decay_cycles=2000)))
    steps = arm.run(20)
    assert {s.mode for s in steps} == {Mode.TRACK}
    assert not any(np.any(s.reaction_velocity) for s in steps)


def test_another_path_is_joined_where_it_is_nearest_and_gently(arm: Arm):
    x = arm.ee()
    circle = Circle((float(x[0]), float(x[1]), float(x[2]) - 0.2), 0.2)  # the arm is at its top
    phases = np.linspace(0.0, circle.length, 100_000)
    nearest = phases[np.argmin([np.linalg.norm(circle.point(s) - x) for s in phases])]
    switch(arm, path=circle)
    steps = arm.run(100)
    assert steps[0].path_phase == pytest.approx(nearest, abs=circle.length / 400)
    assert np.linalg.norm(steps[0].desired_velocity) == 0.0
    most = np.abs(np.diff([s.command for s in steps], axis=0)).max(axis=0)
    assert np.all(most <= arm.model.description.qdd_max * DT + 1e-12)
    assert max(np.linalg.norm(s.ee_position - s.path_position) for s in steps) < 0.02


def test_a_latched_hold_stays_until_a_person_resumes(arm: Arm):
    arm.step(change=lambda robot: replace(robot, q=np.full(7, np.nan)))
    switch(arm, PROFILES["blind"])
    assert arm.run(100)[-1].mode is Mode.HOLD
    assert arm.step(resume=True).mode is Mode.TRACK


def test_a_state_for_another_skin_is_refused(arm: Arm, panda_model: RobotModel, paper_skin: Skin):
    few = Skin(paper_skin.units[:3], panda_model)
    with pytest.raises(RobotStateError, match="another arm or skin"):
        Controller(panda_model, few, arm.controller.fixtures, arm.controller.path, PAPER).adopt(
            arm.state, arm.controller
        )


def test_another_method_begins_anew_and_what_was_learnt_can_be_given(arm: Arm, panda_model, paper_skin):
    ours = Arm(panda_model, paper_skin, PROFILES["pretouch"]).controller
    model = ours.adopt(arm.state, arm.controller).learnt
    assert not model.weights.any()
    again = ours.init(arm.robot(), model._replace(weights=model.weights + 0.5)).learnt
    np.testing.assert_array_equal(again.weights, 0.5)
