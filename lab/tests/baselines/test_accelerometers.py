"""Impacts by accelerometers: the pattern of a link's contact, what is learnt, bounds and decay of the gains."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_t
from tests.contact.alone import sample

from pretouch.contact.cues import Cues
from pretouch.contact.detector import Body
from pretouch.perception.closest import no_obstacles
from pretouch.robot.model import RobotModel
from pretouch.sensing.imu_scale import STANDARD_GRAVITY
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, ImuReadings, RobotState
from pretouch_lab.baselines.accelerometers import BIN_S, SETTLED, Accelerometers, ImpactState, impact_init
from pretouch_lab.baselines.impact_pattern import likelihoods, responses

OURS = Accelerometers()
NOISE = 0.05


def pattern(model: RobotModel, skin: Skin, q: FloatArray) -> FloatArray:
    kin = model.kinematics(q)
    return responses(kin, model.mechanism, OURS.rotor_kg_m2, skin.arrays)


class Rig:
    """An arm that stands, and what its units measure: gravity, a bias, noise, and whatever is added."""

    def __init__(self, model: RobotModel, skin: Skin, params: Accelerometers = OURS) -> None:
        self.model, self.skin, self.params = model, skin, params
        self.q, self.still = model.description.q_ready, np.zeros(model.n)
        self.kin, self.state, self.number = model.kinematics(self.q), impact_init(model, len(skin)), 100
        self.rng = np.random.default_rng(7)
        self.bias = self.rng.uniform(-0.4, 0.4, (len(skin), 3))
        R = self.kin.rotation[skin.link] @ skin.T_link_sensor[:, :3, :3]
        self.weight = R.swapaxes(1, 2) @ np.array([0.0, 0.0, STANDARD_GRAVITY])

    def step(self, jolt: FloatArray | float = 0.0, silent: bool = False) -> FloatArray:
        """One control period in which each unit gives four samples; return the gains."""
        self.number += 1
        now, k = self.number * BIN_S, len(self.skin)
        units = np.repeat(np.arange(k), 0 if silent else 4)
        stamp = np.tile(now - BIN_S * np.array([0.8, 0.6, 0.4, 0.2]), k)[: len(units)]
        felt = (self.weight + self.bias + jolt)[units] + self.rng.normal(0.0, NOISE, (len(units), 3))
        imu = ImuReadings(units, stamp, felt, np.zeros_like(felt))
        robot = RobotState(now, self.q, self.still, self.q, self.still, self.still, np.zeros(6))
        cues, self.state = self.listen(robot, imu, now)
        return cues.gain

    def listen(self, robot: RobotState, imu: ImuReadings, now: float) -> tuple[Cues, ImpactState]:
        body = Body(self.model, self.skin, BIN_S)
        cues, state = self.params.step(self.state, body, sample(self.kin, robot, no_obstacles(), now, imu=imu))
        assert cues is not None
        return cues, state

    def settle(self, steps: int = 300) -> FloatArray:
        return np.array([self.step() for _ in range(steps)])


@pytest.fixture
def rig(panda_model: RobotModel, paper_skin: Skin) -> Rig:
    return Rig(panda_model, paper_skin)


def test_the_pattern_is_that_of_the_equation_of_motion(panda_model, paper_skin):
    q, f = panda_model.description.q_ready, np.array([3.0, -2.0, 1.0])
    A, kin = pattern(panda_model, paper_skin, q), panda_model.kinematics(q)
    h, u = len(panda_model.parts) - 1, 5
    part, link = panda_model.parts[h], paper_skin.link[u]
    at = kin.position[part] + kin.rotation[part] @ panda_model.middle[h]
    M = panda_model.mass_matrix(q) + OURS.rotor_kg_m2 * np.eye(panda_model.n)
    qdd = np.linalg.solve(M, panda_model.jacobian(kin, part, at)[:3].T @ f)
    T = paper_skin.T_link_sensor[u]
    place = kin.position[link] + kin.rotation[link] @ T[:3, 3]
    a = panda_model.jacobian(kin, link, place)[:3] @ qdd
    np.testing.assert_allclose(A[h, u] @ f, (kin.rotation[link] @ T[:3, :3]).T @ a, atol=1e-12)


def test_the_ratio_is_that_of_two_densities():
    rng, g, tails = np.random.default_rng(3), 20.0, 9.0
    A, variance, z = rng.standard_normal((1, 2, 3, 3)), rng.uniform(0.5, 2.0, (2, 3)), rng.standard_normal((2, 3))
    found = np.zeros(1)
    likelihoods(z, variance, np.array([True, True]), A, g, tails, found)
    S, wide = np.diag(variance.reshape(-1)), A[0].reshape(6, 3)
    with_contact = S + g * wide @ np.linalg.solve(wide.T @ np.linalg.solve(S, wide), wide.T)
    expected = [multivariate_t.pdf(z.reshape(-1), shape=shape, df=tails) for shape in (with_contact, S)]
    assert found[0] == pytest.approx(expected[0] / expected[1], rel=1e-4)


def test_no_unit_that_counts_says_nothing():
    found = np.ones(2)
    likelihoods(np.ones((1, 3)), np.ones((1, 3)), np.array([False]), np.ones((2, 1, 3, 3)), 20.0, 9.0, found)
    assert found.tolist() == [0.0, 0.0]


def test_before_a_unit_is_known_gains_are_one(rig):
    gains = np.array([rig.step(1.0 if k > 50 else 0.0) for k in range(SETTLED)])
    assert np.array_equal(gains, np.ones_like(gains))


def test_bias_and_spread_are_learnt_and_free_motion_raises_little(rig):
    rig.settle(1000)
    np.testing.assert_allclose(rig.state.mean, rig.bias, atol=0.04)
    np.testing.assert_allclose(np.sqrt(rig.state.spread), NOISE / 2, rtol=0.35)
    gains = rig.settle(2000)
    assert gains.min() >= 1.0
    assert gains.mean() < 1.0 + 4.0, "E[LR] is 1 a bin, and one is kept for five"


@pytest.mark.parametrize("name", ["panda_hand", "panda_link5"])
def test_an_impact_raises_the_link_that_explains_it_within_the_bound_and_fades(rig, name):
    rig.settle()
    parts, p = rig.model.parts, OURS
    h = int(np.flatnonzero(parts == rig.model.link_index(name))[0])
    jolt = pattern(rig.model, rig.skin, rig.q)[h] @ np.array([4.0, 4.0, 2.0])
    gain = rig.step(jolt)
    assert int(gain.argmax()) == parts[h]
    assert gain.min() >= 1.0
    assert (gain[parts] - 1.0).mean() == pytest.approx(p.gain - 1.0, rel=1e-6)
    later = [rig.step(silent=True) for _ in range(5)][-1]
    assert later[parts[h]] - 1.0 == pytest.approx((gain[parts[h]] - 1.0) * np.exp(-0.05 / p.memory_s), rel=1e-6)


def test_what_only_one_unit_feels_is_no_contact_of_a_link(rig):
    rig.settle()
    jolt = np.zeros((len(rig.skin), 3))
    jolt[0, 0] = 4 * NOISE
    hit = pattern(rig.model, rig.skin, rig.q)[-1] @ np.array([1.0, 0.0, 0.0])
    hit *= np.linalg.norm(jolt) / np.linalg.norm(hit)
    alone = replace_rig(rig).step(jolt).max()
    assert rig.step(hit).max() > 5.0 * alone


def replace_rig(rig: Rig) -> Rig:
    """The same arm, to be stepped beside it: values are never written to."""
    other = Rig(rig.model, rig.skin, rig.params)
    other.state, other.number, other.bias, other.rng = rig.state, rig.number, rig.bias, np.random.default_rng(11)
    return other


def test_late_samples_count_where_they_belong_and_too_late_ones_nowhere(rig):
    rig.settle()
    before: ImpactState = rig.state
    rig.number += 1
    now = rig.number * BIN_S
    stamp = now - np.array([0.035, 0.5])
    imu = ImuReadings(np.zeros(2, np.int64), stamp, np.full((2, 3), 30.0), np.zeros((2, 3)))
    robot = RobotState(now, rig.q, rig.still, rig.q, rig.still, rig.still, np.zeros(6))
    _, after = rig.listen(robot, imu, now)
    assert after.heard.sum() - before.heard.sum() == 1 - 4 * len(rig.skin), "the oldest bin made room"
    assert after.heard[(rig.number - 4) % 8, 0] == 5


def test_time_that_jumps_empties_the_bins_and_keeps_what_is_learnt(rig):
    rig.settle()
    known = rig.state
    rig.number += 500
    assert rig.step(silent=True) == pytest.approx(np.ones(len(rig.model.links)))
    assert np.array_equal(rig.state.mean, known.mean)
    assert rig.state.heard.sum() == 0


def test_a_commanded_acceleration_is_expected(panda_model, paper_skin):
    rig = Rig(panda_model, paper_skin, replace(OURS, follow_1_s=200.0))
    rig.settle()
    speed = np.zeros(panda_model.n)
    speed[0] = 0.05
    rig.still = speed
    number = rig.state.number
    rig.step(silent=True)
    lever = np.abs(rig.state.expected[(number + 1) % 8] - rig.weight).max(axis=1)
    assert lever.max() > 1.0, "0.05 rad/s in 10 ms, about 0.5 m off the axis"
