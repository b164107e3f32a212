"""The sequential detector: external torques less their learnt mean, tested against contacts of each link."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.contact.alarm_level import level_init
from pretouch.contact.model_update import SequentialNumbers, SequentialState, Situation
from pretouch.contact.residual_model import ResidualModel, prior_of, residual_init
from pretouch.contact.scatter import LONGEST, scatter_init, turning_init
from pretouch.contact.sequential import alarm_bound
from pretouch.contact.sequential_step import Joints, SampleTest, assess_sample, sample_test
from pretouch.contact.touch_cue import Cues
from pretouch.params import MisfitParams, ProximityPriorParams, SequentialParams
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, RobotState

_CEILING = 4.0
"""Times the prior that the noise's standard deviations may grow to."""


class Observation(NamedTuple):
    """What one step knows of the arm and about it."""

    kin: Kinematics
    """The arm's posture."""
    robot: RobotState
    """The torques must be numbers."""
    obstacles: Obstacles
    """What is near."""
    cues: Cues
    """What units say of a touch."""


def sequential_init(n: int, p: SequentialParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state of n joints before the first sample; `learnt` is what an earlier session knew of the arm."""
    none = np.zeros(1, np.int64)
    return SequentialState(
        residual_init(n, p) if learnt is None else learnt, np.zeros((LONGEST, n)), none, none, none, np.zeros(3 + n),
        none, turning_init(n), scatter_init(n), level_init(), none,
    )  # fmt: skip


def sequential_numbers(n: int, period: float, p: SequentialParams) -> SequentialNumbers:
    """Return what compiled code takes of the parameters, of n joints and a control period [s]."""
    misfit, near = p.misfit or MisfitParams(), p.proximity or ProximityPriorParams(gain=1.0)
    return SequentialNumbers(
        period, math.exp(-p.observer_gain_1_s * period),
        round(p.relearn_after_s / period) if p.learn != "never" else 0, alarm_bound(p, period),
        ("never", "watched", "always").index(p.learn), prior_of(n, p), (_CEILING * p.velocity_prior_rad_s2) ** 2,
        (_CEILING * p.torque_prior_nm) ** 2, p.widen_at_turns, p.offset_prior_nm, p.proximity is not None,
        p.contact_gain, p.tails, near.gain, near.distance_m, near.horizon_s, p.clear_m, p.suspect, p.slack_nats,
        p.noise_floor_nm, p.bias_floor_nm, p.still_rad_s, p.memory_s, p.spread_memory_s, p.misfit is not None,
        misfit.memory_s,
    )  # fmt: skip


def sequential_step(
    state: SequentialState, model: RobotModel, seen: Observation, reacting: bool, watched: bool,
    numbers: SequentialNumbers,
) -> tuple[SampleTest, SequentialState]:  # fmt: skip
    """Test one sample of the external torques for a contact, and learn from it if nothing can be one.

    Args:
        state: memory.
        model: the arm.
        seen: what the step knows.
        reacting: whether the arm moves with a contact.
        watched: whether a skin watches, all of it heard.
        numbers: of the parameters.
    """
    robot = seen.robot
    model_copy = ResidualModel._make(part.copy() for part in state.model)
    after = SequentialState._make((model_copy, *(part.copy() for part in state[1:])))
    results = sample_test(model.n)
    assess_sample(
        after, Joints(robot.qd, robot.qd_commanded, robot.tau_ext),
        seen.obstacles, Situation(watched, reacting, seen.cues.gain), numbers, seen.kin, model.mechanism, results,
    )  # fmt: skip
    return results, after
