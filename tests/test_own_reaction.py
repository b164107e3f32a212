"""A reaction that somebody else wrote: a class with two methods, named in a profile."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pretouch.contact.reaction import Reaction, ReactionMotion, contact_event
from pretouch.modes import Event
from pretouch.profiles import profile
from pretouch.recording.cycles import KeptState, packed_state
from pretouch.recording.packing import unpacked
from pretouch.types import Mode
from tests.following_arm import PAPER, Arm, on_its_way
from tests.fuzz.invariants import same


@dataclass(frozen=True)
class Rise(Reaction, name="rise"):
    """Goes straight up for some cycles, whatever pushed it. Its state is how many are left."""

    cycles: int = 10
    speed_m_s: float = 0.05

    def init(self, body, q):
        return 0

    def sense(self, state, body, inputs):
        return contact_event(inputs.detection) | ({Event.REACTING: f"{state} cycles"} if state else {}), state

    def move(self, state, body, inputs, mode):
        if mode.mode is not Mode.REACT:
            return None, 0
        left = self.cycles if inputs.mode.mode is not Mode.REACT else state
        return ReactionMotion(np.array([0.0, 0.0, self.speed_m_s])), left - 1


@pytest.fixture
def arm(panda_model, paper_skin) -> Arm:
    return on_its_way(panda_model, paper_skin, replace(PAPER, react=profile("paper:react=rise:react.cycles=20").react))


def test_a_reaction_of_somebody_else_moves_the_arm_as_long_as_it_says(arm: Arm):
    steps = arm.run(6, force=(0.0, 40.0, 0.0))
    height = arm.ee()[2]
    steps += arm.run(100)
    reacting = [step for step in steps if step.mode is Mode.REACT]
    assert len(reacting) == 20
    assert all(step.reaction_velocity.tolist() == [0.0, 0.0, 0.05] for step in reacting)
    assert max(step.ee_position[2] for step in reacting) > height
    assert "for another" in reacting[-1].reason
    assert steps[-1].mode is Mode.TRACK


@pytest.mark.parametrize("name", ["rise", "pretouch"])
def test_its_state_is_recorded_and_another_profile_goes_on_without_it(arm: Arm, panda_model, paper_skin, name: str):
    if name == "pretouch":
        arm = on_its_way(panda_model, paper_skin, profile(name))
    arm.run(6, force=(0.0, 40.0, 0.0))
    assert arm.state.mode.mode is Mode.REACT
    assert same(unpacked(KeptState, packed_state(arm.state, False)), KeptState(False, arm.state))
    paper = Arm(panda_model, paper_skin)
    arm.state, arm.controller = paper.controller.adopt(arm.state, arm.controller), paper.controller
    assert arm.step().mode is (Mode.TRACK if name == "rise" else Mode.HOLD), "a window of another length has to fill"
    assert "as the part rise does" in Rise().announced(0.01)
