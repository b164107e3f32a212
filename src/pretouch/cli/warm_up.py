"""What `pretouch warm-up` does: compile what a control step comes to, and keep it."""

import numpy as np

from pretouch.compiled import kept_in
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import at_rate, profile
from pretouch.realtime import warm_up
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.types import RobotState

_PROFILES = ("paper", "paper:approach.rows=hard", "paper:approach=none", "pretouch")
_RATE_HZ = 1000.0


def compile_step() -> str:
    """Compile a control step of each kind, with points from outside too, and say where that is kept; '' for nowhere."""
    model = RobotModel(panda())
    q, rest = model.description.q_ready, np.zeros(model.n)
    robot = RobotState(0.0, q, rest, q, rest, rest, np.zeros(6))
    for name in _PROFILES:
        params = at_rate(profile(name), _RATE_HZ)
        warm_up(Controller(model, paper_skin(model), no_fixtures(), Circle(), params), robot, points=True)
    return kept_in()
