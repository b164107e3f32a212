"""What the model of free motion cannot express: its scatter, the level it earns, and the corner it kept the test in."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.contact.alone import PERIOD, StandingArm, means_of

from pretouch.contact.detector import Body, Sample
from pretouch.contact.scatter import (
    LENGTHS,
    MAXIMUM_OF,
    detectable_force,
    earned_level,
    learn_level,
    learn_scatter,
    level_init,
    scatter_init,
    spread_out,
)
from pretouch.contact.sequential import log_ratio
from pretouch.contact.sequential_test import SequentialTest
from pretouch.contact.window import window_init
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import RobotState, no_obstacles

N = 3
BOUND, SLACK = math.log(360_000), 7.0


def learnt(draw, times: int = 20_000) -> np.ndarray:
    """Return the scatters (6, N + 2, N) of whitened means (6, N) that are drawn."""
    scatter = scatter_init(N)[1]
    for at in range(times):
        free = means_of(np.eye(N), scatter=scatter)
        free.whitened[:] = draw()
        free.square[:] = (free.whitened**2).sum(axis=1)
        free.ratio[:] = free.whitened**2
        learn_scatter(at, free, 1e6, 1e-4)
    return scatter


def test_the_scatter_is_the_covariance_of_the_whitened_means_of_each_window():
    rng = np.random.default_rng(1)
    mix = np.array([[2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.5, 3.0]])
    factors = np.array([1.0, 1.0, 1.0, 1.0, 2.0, 3.0])[:, None]
    scatter = learnt(lambda: factors * (rng.standard_normal((len(LENGTHS), N)) @ mix.T))
    for k in range(len(LENGTHS)):
        assert_allclose(scatter[k, :N], factors[k] ** 2 * (mix @ mix.T), rtol=0.35, atol=0.6 * factors[k, 0] ** 2)


def test_an_outlier_counts_less_and_never_nothing():
    scatter = scatter_init(N)[1]
    free = means_of(np.eye(N), scatter=scatter)
    free.whitened[:], free.square[:] = 100.0, 3e4
    learn_scatter(0, free, 20.0, 1e-4)
    grown = scatter[0, 0, 0] - 1.0
    assert 0.0 < grown < 1.0, "a mean a hundred deviations off would add 500 if it counted as any other"


def test_the_spread_is_that_of_white_noise_times_the_scatter():
    rng = np.random.default_rng(2)
    A, B = rng.standard_normal((2, N, N))
    S, wide = A @ A.T + np.eye(N), B @ B.T + np.eye(N)
    L, scatter = np.linalg.cholesky(S), np.zeros((N + 2, N))
    scatter[:N] = wide
    before = L.copy()
    spread_out(scatter, L, np.empty((N, N)))
    assert_allclose(L @ L.T, before @ wide @ before.T, rtol=1e-12)
    assert_array_equal(L, np.tril(L))


def level_of(draw, blocks: int = 2000) -> float:
    seen = level_init()[1]
    for _ in range(blocks):
        for value in draw(MAXIMUM_OF):
            learn_level(float(value), seen)
    return earned_level(seen, BOUND, SLACK)


def test_the_level_begins_in_the_middle_a_quiet_arm_gets_all_the_slack_and_one_that_rings_loses_it_in_half_a_minute():
    rng = np.random.default_rng(3)
    assert earned_level(level_init()[1], BOUND, SLACK) == pytest.approx(BOUND - 4.7, abs=0.1)
    assert level_of(lambda size: 1.0 + 2.0 * rng.gumbel(size=size), blocks=120) == BOUND
    assert level_of(lambda size: -3.0 + 0.5 * rng.gumbel(size=size)) == BOUND - SLACK


def test_between_both_it_is_the_level_that_maxima_pass_at_the_rate():
    rng = np.random.default_rng(4)
    # P(value > x) = exp(-(x - 1) / s) far out: one in 360 000 is above 1 + 12.8 s, and the tail's surplus comes on top
    scale = 0.55
    level = level_of(lambda size: 1.0 + scale * rng.gumbel(size=size))
    assert level == pytest.approx(1.0 + scale * (BOUND + 1.0), abs=0.8)


def test_touches_that_no_unit_sees_raise_it_to_the_bound_at_most():
    rng = np.random.default_rng(5)

    def touched(size: int) -> np.ndarray:
        return rng.gumbel(size=size) + (300.0 if rng.uniform() < 0.5 else 0.0)

    assert level_of(touched) == BOUND


def test_a_new_start_keeps_the_stated_force_of_an_arm_that_sways(panda_model: RobotModel):
    """Torques that last longer than noise count as scatter: a detector that forgets it states half of the force."""
    arm, sway = StandingArm(panda_model, 9), np.zeros(3)
    state = arm.test.init(arm.body)
    for _ in range(900):
        sway = 0.98 * sway + 0.5 * arm.rng.standard_normal(3)
        before, state = arm.test.step(state, arm.body, arm.sample(sway))
    model = arm.test.learnt(state)
    forgetful = model._replace(scatter=scatter_init(arm.body.model.n), level=level_init())
    begun = (arm.test.init(arm.body, one) for one in (model, forgetful))
    first, lost = (arm.test.step(s, arm.body, arm.sample(np.zeros(3)))[0].detectable_n for s in begun)
    assert first == pytest.approx(before.detectable_n, rel=0.02)
    assert lost < 0.7 * before.detectable_n


@pytest.mark.slow
@pytest.mark.parametrize(
    ("minutes", "bound", "way", "rest", "most_n"), [(30, 0.3, 0.05, 0.0, np.inf), (4, 3.0, 0.01, 0.15, 20.0)]
)
def test_friction_that_remembers_gives_no_alarm_after_a_minute(panda_model, minutes, bound, way, rest, most_n):
    """Where a joint last turned round or stopped decides its friction: little of it, and that of gears which rest.

    As scatter alone, that of gears would raise the stated force to 60 N.
    """
    ours = replace(profile("pretouch").detect, localise=None, touch=None)
    alarms, stated = zip(*stream(panda_model, ours, 6000 * minutes, bound, way, rest), strict=True)
    assert not any(alarms[6000:])
    assert np.median(stated[6000:]) < most_n


def stream(
    model: RobotModel, test: SequentialTest, samples: int, bound: float, way: float, rest: float
) -> Iterator[tuple[bool, float]]:
    """Yield for each sample of a motion that nobody touches whether a contact is detected, and the stated force [N].

    Joints move at 0.4 rad/s less `rest`, and stand below it. Dahl's friction of `bound` [Nm] follows over `way` [rad].
    """
    body, rng = Body(model, Skin((), model), 0.01), np.random.default_rng(6)
    state, window, n = test.init(body), window_init(500), model.n
    rate, memory, q = np.linspace(0.5, 1.1, n), np.zeros(n), model.description.q_ready
    for i in range(samples):
        t = 0.01 * i
        qd = 0.4 * np.cos(rate * t)
        qd = np.sign(qd) * np.maximum(np.abs(qd) - rest, 0.0)
        q = q + 0.01 * qd
        memory += 0.01 * qd / way * (bound - np.sign(qd) * memory)
        robot = RobotState(t, q, qd, q, qd, memory + 0.2 * rng.standard_normal(n), None)
        sample = Sample(t, model.kinematics(q), robot, window, True, no_obstacles(), False, True)
        said, state = test.step(state, body, sample)
        yield said.contact is not None, said.detectable_n


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_what_grows_slowly_where_no_unit_sees_it_is_felt_and_not_learnt_away(panda_model: RobotModel, seed: int):
    arm = StandingArm(panda_model, seed)
    state, _ = arm.learnt(180.0)
    push = arm.rng.standard_normal(3)
    push /= np.linalg.norm(push)
    for i in range(2000):
        # by 1 N/s
        said, state = arm.test.step(state, arm.body, arm.sample(PERIOD * i * push))
        if said.contact is not None:
            break
    assert PERIOD * i < 4.0


GAIN, TAILS, NEEDED, FAST, J = 15.0, 30.0, 10.0, 1e6, np.eye(6, 3)


def test_by_hand_for_a_cartesian_arm():
    """Three joints of which each moves one axis, with 2, 4 and 1 Nm of noise: the second tells least."""
    free = means_of(np.diag([4.0, 16.0, 1.0]))
    found = detectable_force(J, PERIOD, free, NEEDED, GAIN, TAILS, 60.0)
    # eight samples fit into 0.1 s; an observer of 1 / 60 s shows from 1 - exp(-1.2) to 1 - exp(-6) of the force in them
    part = 1.0 - (0.301194 - 0.002479) / 4.8
    whitened = part * found / (4.0 / math.sqrt(8.0)) - 1.725
    square = whitened**2
    ratio = log_ratio(math.log1p((square + 3) / TAILS), square + 3, square + 3, 3, 3, GAIN, math.log1p(GAIN), TAILS)
    assert ratio == pytest.approx(NEEDED, abs=1e-5)


def test_noise_that_lasts_does_not_average_out():
    white = detectable_force(J, PERIOD, means_of(np.eye(3)), NEEDED, GAIN, TAILS, FAST)
    lasting = detectable_force(J, PERIOD, means_of(1e-9 * np.eye(3), 1.0), NEEDED, GAIN, TAILS, FAST)
    assert lasting == pytest.approx(math.sqrt(8.0) * white, rel=1e-6)


def test_a_scatter_of_four_doubles_it():
    scatter = scatter_init(3)[1]
    scatter[:, :3] = 4.0 * np.eye(3)
    white = detectable_force(J, PERIOD, means_of(np.eye(3)), NEEDED, GAIN, TAILS, FAST)
    wide = detectable_force(J, PERIOD, means_of(np.eye(3), scatter=scatter), NEEDED, GAIN, TAILS, FAST)
    assert wide == pytest.approx(2.0 * white, rel=1e-9)


def test_what_no_joint_shows_and_what_tails_forbid_is_never_found():
    free = means_of(np.eye(3))
    assert detectable_force(np.zeros((6, 3)), PERIOD, free, NEEDED, GAIN, TAILS, FAST) == math.inf
    assert detectable_force(J * [1.0, 1.0, 0.0], PERIOD, free, NEEDED, GAIN, TAILS, FAST) == math.inf
    assert detectable_force(J, PERIOD, free, 60.0, GAIN, 3.0, FAST) == math.inf


@pytest.mark.slow
def test_what_it_says_is_found_in_95_of_100_cases_and_less_is_not(panda_model):
    found, less = [], []
    for seed in range(8):
        arm = StandingArm(panda_model, seed)
        state, says = arm.learnt(40.0)
        # the direction that the torques tell least of
        worst = np.linalg.eigh(arm.J @ np.diag(1.0 / arm.sigma**2) @ arm.J.T)[1][:, 0]
        sign = arm.rng.choice([-1.0, 1.0], 40)
        found += [arm.finds(state, says * s * worst) for s in sign]
        less += [arm.finds(state, 0.5 * says * s * worst) for s in sign]
    assert np.mean(found) > 0.93
    assert np.mean(less) < 0.5
