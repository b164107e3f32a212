"""The force that the sequential test says it finds, held against pushes of that force."""

import math

import numpy as np
import pytest
from tests.contact.standing_arm import PERIOD, StandingArm, means_of

from pretouch.contact.scatter import detectable_force, scatter_init
from pretouch.contact.sequential import log_ratio
from pretouch.params import MisfitParams

GAIN, TAILS, NEEDED = 15.0, 30.0, 10.0


def test_by_hand_for_a_cartesian_arm():
    """Three joints of which each moves one axis, with 2, 4 and 1 Nm of noise: the second tells least."""
    J, sigma = np.vstack((np.eye(3), np.zeros((3, 3)))), np.array([2.0, 4.0, 1.0])
    free = means_of(np.diag(sigma**2))
    found = detectable_force(J, PERIOD, free, NEEDED, GAIN, TAILS)
    # eight samples fit into 0.1 s
    whitened = found / (4.0 / math.sqrt(8.0)) - 1.645
    square = whitened**2
    ratio = log_ratio(math.log1p((square + 3) / TAILS), square + 3, square + 3, 3, 3, GAIN, math.log1p(GAIN), TAILS)
    assert ratio == pytest.approx(NEEDED, abs=1e-9)


def test_noise_that_lasts_does_not_average_out():
    J = np.vstack((np.eye(3), np.zeros((3, 3))))
    white = detectable_force(J, PERIOD, means_of(np.eye(3)), NEEDED, GAIN, TAILS)
    lasting = detectable_force(J, PERIOD, means_of(1e-9 * np.eye(3), 1.0), NEEDED, GAIN, TAILS)
    assert lasting == pytest.approx(math.sqrt(8.0) * white, rel=1e-6)


def test_a_scatter_of_four_doubles_it():
    J = np.vstack((np.eye(3), np.zeros((3, 3))))
    scatter = scatter_init(3)[1]
    scatter[:, :3] = 4.0 * np.eye(3)
    white = detectable_force(J, PERIOD, means_of(np.eye(3)), NEEDED, GAIN, TAILS)
    wide = detectable_force(J, PERIOD, means_of(np.eye(3), scatter=scatter), NEEDED, GAIN, TAILS)
    assert wide == pytest.approx(2.0 * white, rel=1e-9)


def test_what_no_joint_shows_and_what_tails_forbid_is_never_found():
    free = means_of(np.eye(3))
    assert detectable_force(np.zeros((6, 3)), PERIOD, free, NEEDED, GAIN, TAILS) == math.inf
    across = np.vstack((np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3))))
    assert detectable_force(across, PERIOD, free, NEEDED, GAIN, TAILS) == math.inf
    # with so heavy tails even the largest outlier is no contact
    all_axes = np.vstack((np.eye(3), np.zeros((3, 3))))
    assert detectable_force(all_axes, PERIOD, free, 60.0, GAIN, 3.0) == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("misfit", [None, MisfitParams()], ids=["without misfit", "with"])
def test_what_it_says_is_found_in_95_of_100_cases_and_less_is_not(panda_model, misfit):
    found, less = [], []
    for seed in range(8):
        arm = StandingArm(panda_model, misfit, seed)
        state, says = arm.learnt(40.0)
        # the direction that the torques tell least of
        worst = np.linalg.eigh(arm.J @ np.diag(1.0 / arm.sigma**2) @ arm.J.T)[1][:, 0]
        sign = arm.rng.choice([-1.0, 1.0], 40)
        found += [arm.finds(state, says * s * worst) for s in sign]
        less += [arm.finds(state, 0.5 * says * s * worst) for s in sign]
    assert np.mean(found) > 0.93
    assert np.mean(less) < 0.5


def test_a_louder_arm_says_a_larger_force(panda_model):
    quiet, loud = StandingArm(panda_model, MisfitParams(), 3), StandingArm(panda_model, MisfitParams(), 3)
    loud.sigma = 3.0 * loud.sigma
    # not three times: floors of the noise are in both, and an arm that is as learnt earns a lower level
    assert 1.5 < loud.learnt(40.0)[1] / quiet.learnt(40.0)[1] <= 3.0
