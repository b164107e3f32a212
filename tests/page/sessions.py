"""What the tests of a live session do with it."""

from dataclasses import replace

import numpy as np

from pretouch.page.simulation import LiveSimulation
from pretouch.types import ControlStep, Mode

AWAY = np.array([1.2, 0.0, 0.8])
ARMED_S = 1.2
"""By then the force window is full."""


def poke(session: LiveSimulation, patience: float = 8.0) -> list[ControlStep]:
    """Draw the hand onto the robot's hand until the arm reacts, then away."""
    steps: list[ControlStep] = []
    while session.frame.step.mode is not Mode.REACT:
        assert len(steps) < 100 * patience, "the arm has not noticed"
        palm = session.model.link_index("panda_hand")
        kin = session.model.kinematics(session.frame.step.q)
        session.move_hand(kin.position[palm] + kin.rotation[palm] @ [0.0, 0.0, 0.045])
        steps.append(session.single_step())
    session.move_hand(AWAY)
    return steps


def modes(steps: list[ControlStep]) -> list[Mode]:
    """Modes in turn."""
    return [s.mode for i, s in enumerate(steps) if i == 0 or s.mode is not steps[i - 1].mode]


def set_speed(session: LiveSimulation, speed: float) -> None:
    """Follow the path at another speed [m/s]."""
    profile = session.settings.profile
    session.set_profile(replace(profile, task=replace(profile.task, speed_m_s=speed)))
