"""Yielding, a clamp and a board that stays, in the simulation with its noise, lag and friction."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.params import GiveUpParams
from pretouch.profiles import Profile, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import FREE_N, USUAL_ARM, HandGoal, Push, Pusher, point_on_arm
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.types import FloatArray, Mode
from pretouch_lab.trial import Record, Setup, play

SEED = 1007
SLOW = "pretouch:approach=none:task.speed_m_s=0.02"


class Holder(Pusher):
    """A person who keeps pushing at one place, with one force: a hand that only pushes on slides past the arm's."""

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Reach, push and withdraw as planned, but from the touch on stay on the line of the push through the palm."""
        planned = super().goal(time, hand, plant)
        if self._touch is None:
            return planned
        palm = point_on_arm(plant, self._robot.link, self._robot.palm)
        # ahead by what stretches the person's arm to the planned force; what it takes to stay on the line comes on top
        ahead = (hand - palm) @ self._direction + planned.force_max / USUAL_ARM.stiffness
        return HandGoal(palm + ahead * self._direction, FREE_N)


def pushed(model: RobotModel, skin: Skin, params: Profile, held_s: float, until: float, boxes=()) -> tuple:
    """Record of an arm that stands almost still at y = -0.25 m and is pushed to +y with 25 N."""
    person = Holder(model, (Push(1.5, np.array([0.0, -1.0, 0.0]), 25.0, held_s),))
    scene = SceneSpec(hand=HandSpec(), boxes=boxes)
    setup = Setup(model, skin, params, scene, Circle(start_angle=np.pi), SEED, hand=person)
    record = play(setup, lambda step, _: step.stamp > until)
    (span,) = person.contacts
    assert span is not None
    return record, *span


def speeds(record: Record, start: float, end: float) -> np.ndarray:
    """Reaction speeds towards +y [m/s] of the steps in a span [s]."""
    return np.array([s.reaction_velocity[1] for s in record.steps if start <= s.stamp <= end])


@pytest.mark.slow
def test_an_arm_goes_with_a_hand_and_stands_when_it_is_let_go(panda_model, paper_skin):
    record, touch, release = pushed(panda_model, paper_skin, profile(SLOW), held_s=2.0, until=6.0)
    y = {round(s.stamp, 2): s.ee_position[1] for s in record.steps}
    assert 0 < next(s.stamp for s in record.steps if s.contact is not None) - touch < 0.15
    assert speeds(record, touch, release).min() >= -0.005, "never towards the person"
    way = y[round(release, 2)] - y[round(touch, 2)]
    assert 0.24 < way < profile(SLOW).react.reach_m, "for as long as it is pushed, up to the reach of a contact"
    after = speeds(record, release, release + 1.0)
    assert after.max() <= after[0] + 0.02, "let go, it is not accelerated"
    assert np.abs(after[50:]).max() < 0.02
    assert abs(y[round(release + 1.0, 2)] - y[round(release, 2)]) < 0.06


@pytest.mark.slow
def test_pushed_against_a_board_it_opens_and_holds(panda_model, paper_skin):
    board = Box("object", (0.5, -0.25 + 0.102 + 0.12 + 0.02, 0.307), (0.3, 0.02, 0.2), 25_000.0)
    record, _, _ = pushed(panda_model, paper_skin, profile(SLOW), held_s=1.0, until=5.0, boxes=(board,))
    last = record.steps[-1]
    assert last.mode is Mode.HOLD
    assert "clamped between two objects" in last.reason
    free = record.true_time > last.stamp - 0.5
    assert np.linalg.norm(record.true_force[free], axis=1).max() < 5.0, "it does not lean on the board"


@pytest.mark.slow
def test_a_board_that_stays_is_given_up(panda_model, paper_skin):
    params = profile("pretouch:approach=none")
    params = replace(params, react=replace(params.react, give_up=GiveUpParams(contacts=2), patience_s=1.0))
    scene, path = static_scene("line", "+y", 25_000.0, SEED), static_path("line", "+y")
    record = play(Setup(panda_model, paper_skin, params, scene, path, SEED), lambda step, _: step.stamp > 16.0)
    assert len(record.reactions()) == 2
    assert record.steps[-1].mode is Mode.HOLD
    assert "2 contacts at one place" in record.steps[-1].reason
