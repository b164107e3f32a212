"""What is still known of free motion after a pause, as from one session to the next."""

import math
from dataclasses import replace

import numpy as np

from pretouch.contact.residual_model import PLAIN, ResidualModel, prior_of
from pretouch.params import SequentialParams

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
