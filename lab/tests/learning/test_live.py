import numpy as np
import pytest

from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch.types import Mode
from pretouch.viewer.room import LiveSettings
from pretouch.viewer.simulation import LiveSimulation
from pretouch_lab.learning.live import PolicyCommander
from pretouch_lab.learning.observation import NEAR_M
from pretouch_lab.learning.policy import Policy


def straight(actions=6, numbers=27):
    """Five times the way to the goal, which is the fourth to sixth number observed."""
    weight = np.zeros((actions, numbers))
    weight[range(3), range(3, 6)] = 5.0
    return Policy("by hand", np.zeros(numbers), np.ones(numbers), ((weight, np.zeros(actions)),), np.zeros((0, 2)))


@pytest.fixture
def live():
    simulation = LiveSimulation(LiveSettings(profile=profile("pretouch")))
    simulation.commander = PolicyCommander(straight(), simulation, 1)
    return simulation


def test_it_goes_from_goal_to_goal_with_actions_that_do_not_go_stale(live):
    first, ages = live.commander.goal, []
    for _ in range(500):
        step = live.single_step()
        asked = live.frame.inputs.desired
        ages.append(round(step.stamp - asked.stamp[-1], 6))
        if live.commander.goal is not first:
            break
    assert np.linalg.norm(step.ee_position - first) < NEAR_M
    assert step.mode is Mode.TRACK
    assert sorted(set(ages)) == pytest.approx([0.01, 0.02, 0.03, 0.04, 0.05])
    assert live.notice.startswith("The policy goes to (0.50, ")


def test_it_begins_again_with_the_simulation(live):
    for _ in range(200):
        live.single_step()
    live.reset()
    step = live.single_step()
    assert step.stamp - live.frame.inputs.desired.stamp[-1] <= 0.05


def test_a_policy_for_another_arm_is_refused(live):
    with pytest.raises(ExperimentError, match="is given 27 numbers and answers 7, not 27 and 6: give one that was"):
        PolicyCommander(straight(7), live)
    with pytest.raises(ExperimentError, match="is given 52 numbers"):
        PolicyCommander(straight(6, 52), live)
