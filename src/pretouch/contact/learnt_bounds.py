"""What was learnt of free motion in an earlier session: bounds by physics, and what is still known after a pause."""

import math
from dataclasses import replace

import numpy as np

from pretouch.contact.residual_model import PLAIN, ResidualModel, prior_of
from pretouch.errors import ParameterError
from pretouch.params import SequentialParams
from pretouch.robot.model import RobotModel

_NOISIEST = 100.0
"""Noise of the measured joint velocities times the observer's gain [rad/s^2]: a real Panda's is 0.5."""


def check_learnt(learnt: ResidualModel, model: RobotModel) -> None:
    """Refuse, by a ParameterError, what no free motion of an arm can be: believed, it would hide every contact.

    Offset, friction and noise of a joint stay within the torque it can give, the error of a link's mass within that
    mass, and an unknown load within the mass of the arm. None is less certain than by its bound.
    """
    torque, n = model.description.tau_max, model.n
    largest = np.column_stack([*[torque] * PLAIN, np.ones((n, n)), np.full(n, model.mass.sum())])
    noisiest = np.stack([np.full(n, _NOISIEST), torque]) ** 2
    known = np.diagonal(learnt.covariance, axis1=1, axis2=2)
    for name, found, bound in (
        ("weight", np.abs(learnt.weights), largest), ("variance", known, largest**2),
        ("spread", learnt.spread.max(axis=0), noisiest),
    ):  # fmt: skip
        at = np.unravel_index(int(np.argmax(found / bound)), bound.shape)
        if not found[at] <= bound[at]:
            raise ParameterError(
                f"What was learnt has a {name} of {found[at]:.3g}, beyond the {bound[at]:.3g} that this arm can have:"
                " learn it anew."
            )


_DRIFT = 0.25
"""Part of the prior's standard deviations that offset and friction may drift by while nobody looks: an arm cools."""
_COOLING_S = 300.0  # an assumption


def rested(model: ResidualModel, pause_s: float, p: SequentialParams) -> ResidualModel:
    """Return the model after a pause [s]: the mean as it was, its covariance larger, the noise covariance as it was.

    Within minutes the covariance of offset and friction goes part of the way to the prior, and that of the payload all
    of it, for what the arm holds may be another. The links' masses stay what they are.
    """
    n = len(model.weights)
    prior, gone = prior_of(n, p), -math.expm1(-max(pause_s, 0.0) / _COOLING_S)
    share = np.zeros(len(prior))
    share[:PLAIN], share[-1] = _DRIFT**2 * gone, gone
    left = np.sqrt(1.0 - share)
    # scaled from both sides, by which it stays positive definite: of each variance a share is replaced by the prior's
    covariance = model.covariance * (left[:, None] * left) + np.diag(share * prior)
    return replace(model, covariance=covariance)
