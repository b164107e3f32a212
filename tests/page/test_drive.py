"""Driving the arm from a page: what a visitor asks is done while that visitor is there."""

from typing import Any

import numpy as np
import pytest
from tests.page.test_door import turns
from tests.page.visitor import Visitor, control

from pretouch.desired import DesiredKind
from pretouch.page.drive import REACH_M, TASKS, Steering
from pretouch.page.frame import driven_motion
from pretouch.page.live import LivePage
from pretouch.page.replay import frame_of, world_of
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.types import FloatArray, Mode


@pytest.fixture
def driver(page, options):
    """Somebody who drives an arm that stands."""
    page._simulation.advance(1.5)
    with Visitor(page._server, options) as somebody:
        do(page, somebody, control(page, "Task"), TASKS[1])
        turns(page, 30)
        yield somebody


def do(page: LivePage, visitor: Visitor, handle: Any, value: object) -> None:
    """Have a visitor set a control, and the page do it."""
    visitor.set(handle, value)
    visitor.settle()
    turns(page, 1)


def aim(page: LivePage, visitor: Visitor, position: FloatArray, wxyz: tuple[float, ...] = (0.0, 1.0, 0.0, 0.0)) -> None:
    """Have a visitor drag the target, the hand's fingers down."""
    place = {"wxyz": list(wxyz), "position": position.tolist()}
    visitor.say({"type": "TransformControlsUpdateMessage", "name": "/target", "owner": "", **place})
    visitor.settle()
    turns(page, 1)


def hand(page: LivePage) -> FloatArray:
    return page._simulation.frame.step.ee_position


def speed(page: LivePage) -> float:
    """Speed at which the end-effector is commanded [m/s]."""
    frame, world = page._simulation.frame, page._simulation.world
    motion = driven_motion(frame, world, world.model.kinematics(frame.step.q))
    assert motion
    return float(np.linalg.norm(motion.velocities[1]))


def test_the_arm_stands_where_it_was_until_somebody_drives(page, driver):
    before = hand(page)
    turns(page, 30)
    np.testing.assert_allclose(hand(page), before, atol=0.002)
    assert page._simulation.frame.step.mode is Mode.TRACK
    np.testing.assert_allclose(page.drive._target.position, hand(page), atol=0.01)
    do(page, driver, control(page, "Task"), TASKS[0])
    turns(page, 60)
    assert page._simulation.frame.inputs.desired is None
    assert np.linalg.norm(hand(page) - before) > 0.1
    assert not page.drive._target.visible


def test_the_hand_goes_to_a_target_that_is_dragged_and_stays(page, driver):
    goal = hand(page) + np.array([-0.05, 0.1, 0.05])
    aim(page, driver, goal)
    turns(page, 120)
    np.testing.assert_allclose(hand(page), goal, atol=0.005)
    assert page._simulation.frame.inputs.desired.kind is DesiredKind.POSE
    aim(page, driver, goal + 0.1, (0.0, 0.0, 0.0, 0.0))  # no orientation
    turns(page, 15)
    np.testing.assert_allclose(hand(page), goal, atol=0.005)


def test_a_driver_who_leaves_has_the_arm_come_to_rest_and_the_next_goes_on(page, options, driver):
    with Visitor(page._server, options) as other:
        aim(page, other, hand(page) + np.array([0.0, 0.4, 0.0]))
        turns(page, 10)
        assert speed(page) > 0.1
    turns(page, 15)
    step = page._simulation.frame.step
    assert (step.mode, step.reason.split(" ended ")[0]) == (Mode.HOLD, "The desired motion")
    assert np.abs(step.command).max() < 1e-9
    rest = hand(page)
    turns(page, 30)
    np.testing.assert_allclose(hand(page), rest, atol=0.002)
    aim(page, driver, rest)
    turns(page, 3)
    assert page._simulation.frame.step.mode is Mode.TRACK


def test_a_reset_has_a_driven_arm_stand_at_its_beginning(page, driver):
    aim(page, driver, hand(page) + np.array([0.0, 0.3, 0.0]))
    turns(page, 10)
    do(page, driver, control(page, "Reset"), True)
    begun = hand(page)
    turns(page, 60)
    np.testing.assert_allclose(hand(page), begun, atol=0.003)
    assert page._simulation.frame.step.mode is Mode.TRACK


@pytest.mark.slow
def test_a_drive_at_the_person_is_recorded_shown_again_and_replayed_to_the_bit(page, driver, tmp_path):
    simulation, start = page._simulation, hand(page)
    simulation.move_hand(start + np.array([0.0, 0.4, 0.05]))
    turns(page, 60)
    simulation.start_recording(tmp_path / "drive.mcap")
    turns(page, 5)
    aim(page, driver, simulation.hand_target)
    turns(page, 90)
    simulation.stop_recording()
    recorded = open_recording(tmp_path / "drive.mcap")
    verdict = verify(recorded)
    assert verdict.exact, verdict.sentence
    assert (verdict.checked, verdict.skipped) == (len(recorded), {})
    assert {cycle.inputs.desired.kind for cycle in recorded} == {DesiredKind.TWIST, DesiredKind.POSE}
    last, world = recorded[len(recorded) - 1], world_of(recorded.runs[0])
    motion = driven_motion(frame_of(last), world, world.model.kinematics(last.step.q))
    assert motion
    np.testing.assert_allclose(motion.goal[:3, 3], simulation.hand_target)
    limits = [cycle.step.limited for cycle in recorded]
    assert {simulation.skin.ids[limit.unit] for limit in limits if limit.unit >= 0} >= {"hand_left"}
    assert max(np.linalg.norm(cycle.truth.force, axis=1).max() for cycle in recorded) < 30.0


def test_a_target_counts_until_another_is_asked_and_lies_within_reach():
    steering = Steering()
    steering.attended = True
    assert steering(0.5).kind is DesiredKind.TWIST
    assert not steering(0.5).number.any()
    turned = np.diag([1.0, -1.0, -1.0])
    steering.target(np.array([0.5, -9.0, 0.3]), turned)
    for now in (1.0, 100.0):
        motion = steering(now)
        assert (motion.kind, motion.stamp.tolist()) == (DesiredKind.POSE, [now])
        assert motion.number[0].tolist() == [0.5, -REACH_M, 0.3, *turned.ravel()]


def test_what_is_asked_ages_while_who_asked_it_is_away():
    steering = Steering()
    steering.attended = True
    steering(2.0)
    steering.attended = False
    assert [float(steering(now).stamp[0]) for now in (2.5, 9.0)] == [2.0, 2.0]
    assert float(steering(0.3).stamp[0]) == 0.3  # after a reset it is of now at most, and ages from there
    assert float(steering(0.4).stamp[0]) == 0.3
