"""The opening as the simulation plays it: what the arm does about the scripted hand, without a page."""

import numpy as np
import pytest

from pretouch.explanation import Doing, explain
from pretouch.page.room import LiveSettings
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import skin_for
from pretouch.types import ControlStep, Mode

SHOWN_S = 10.0
"""Time within which the promise is to be seen."""


class Played:
    """An opening from its begin to its end."""

    def __init__(self, model: RobotModel, name: str) -> None:
        self.simulation = LiveSimulation(LiveSettings(profile=profile(name)), model, skin_for(model))
        self.simulation.play_opening()
        self.steps: list[ControlStep] = []
        self.force: list[float] = []
        while self.simulation.opening and self.simulation.time < 2 * SHOWN_S:
            self.steps.append(self.simulation.single_step())
            true = self.simulation.frame.true_force
            self.force.append(0.0 if true is None else float(np.linalg.norm(true)))

    @property
    def touch(self) -> int:
        """The step of the first touch."""
        return int(np.argmax(np.array(self.force) > 0.5))

    def slowest_before(self) -> float:
        """Least speed over the path's before the touch, once the arm has started."""
        steps = [step for step in self.steps[: self.touch] if step.mode is Mode.TRACK and step.stamp > 2.0]
        return (
            min(float(np.linalg.norm(step.ee_velocity)) for step in steps)
            / self.simulation.settings.profile.task.speed_m_s
        )


@pytest.fixture(scope="module")
def protected(panda_model):
    return Played(panda_model, "pretouch")


@pytest.fixture(scope="module")
def blind(panda_model):
    return Played(panda_model, "blind")


def test_the_arm_sees_the_hand_waits_for_it_is_pushed_yields_and_goes_on(protected):
    assert protected.slowest_before() < 0.2
    model, skin = protected.simulation.model, protected.simulation.skin
    second = [explain(step, skin.ids, model.links) for step in protected.steps[protected.touch - 100 : protected.touch]]
    assert {explanation.doing for explanation in second} <= {Doing.WAITING, Doing.AVOIDING}
    assert any(explanation.doing is Doing.WAITING for explanation in second)
    assert all(" something at 0.0" in one.sentence and "hand_left" in one.sentence for one in second)
    contacts = [s.stamp for s in protected.steps if s.contact is not None]
    touched = protected.steps[protected.touch].stamp
    assert touched <= contacts[0] < touched + 0.1
    modes = [s.mode for i, s in enumerate(protected.steps) if i == 0 or s.mode is not protected.steps[i - 1].mode]
    off = [np.linalg.norm(s.ee_position - s.path_position) for s in protected.steps if s.mode is Mode.REACT]
    assert max(off) > 0.08, "it has moved with the push"
    assert modes[-3:] == [Mode.TRACK, Mode.REACT, Mode.TRACK]
    assert protected.steps[-1].stamp < SHOWN_S
    assert protected.simulation.opening is None


def test_a_blind_arm_runs_into_the_same_hand_unslowed_and_with_more_force(protected, blind):
    assert blind.slowest_before() > 0.8
    assert max(protected.force) < max(blind.force)
    assert max(blind.force) > 30.0


@pytest.mark.parametrize("how", ["move", "point"])
def test_a_person_who_moves_the_hand_ends_it_at_once(panda_model, how):
    simulation = LiveSimulation(model=panda_model)
    simulation.play_opening()
    simulation.advance(3.0)
    assert simulation.opening
    place = np.array([0.9, 0.6, 0.5])
    if how == "move":
        simulation.move_hand(place)
    else:
        simulation.point_hand(np.array([1.75, 0.95, 0.85]), place)
    simulation.advance(0.5)
    assert simulation.opening is None
    np.testing.assert_allclose(simulation.frame.hand_target, place, atol=0.01)
