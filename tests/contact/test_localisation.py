"""Contact localisation: likelihoods against linear algebra, noiseless contacts found again, priors."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.contact.alone import sample, something, standing
from tests.examples import examples

from pretouch.contact.detector import Body
from pretouch.contact.localisation import NO_CONTACT, LocalisationState, candidate_poses, hidden_candidates, localise
from pretouch.contact.posterior import Candidates, log_posterior, log_prior
from pretouch.contact.scatter import LENGTHS
from pretouch.contact.sequential_step import SampleTest
from pretouch.contact.touch_cue import Cues, gain_of, no_cues, surface_areas
from pretouch.params import LocalisationParams, TouchSensorParams
from pretouch.records import zeros
from pretouch.robot.body import placed
from pretouch.robot.description import panda
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.types import FloatArray, Obstacles, Touched, no_obstacles

MODEL = RobotModel(panda())
SURFACE = MODEL.surface
N = MODEL.n
PERIOD = 0.01
NOISE = np.diag([0.09, 0.12, 0.09, 0.12, 0.01, 0.01, 0.002])
MODEL_VARIANCE = np.full(N, 1e-4)
P = LocalisationParams()
NUMBERS = P.numbers
BODY = Body(MODEL, Skin((), MODEL), PERIOD)


def posture(seed: int = 0) -> Kinematics:
    q = MODEL.description.q_ready + np.random.default_rng(seed).uniform(-0.3, 0.3, N)
    return MODEL.kinematics(q)


def pose_of(kin: Kinematics, c: int) -> tuple[FloatArray, FloatArray]:
    """Return a candidate's point and normal in the base frame."""
    link = SURFACE.link[c]
    return kin.position[link] + kin.rotation[link] @ SURFACE.point[c], kin.rotation[link] @ SURFACE.normal[c]


def poses(kin: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Return points and normals (N, 3) of all candidates in the base frame."""
    point, normal = np.empty((len(SURFACE.link), 3)), np.empty((len(SURFACE.link), 3))
    candidate_poses(kin, SURFACE, point, normal)
    return point, normal


def exposed(kin: Kinematics) -> FloatArray:
    """Which candidates (N,) nothing hides."""
    capsules, hidden = placed(MODEL.capsules, kin), np.empty(len(SURFACE.link), np.bool_)
    hidden_candidates(poses(kin)[0], SURFACE.body, capsules, MODEL.rigid[capsules.link], hidden)
    return ~hidden


def torques(kin: Kinematics, *contacts: tuple[int, float]) -> FloatArray:
    total = np.zeros(N)
    for c, size in contacts:
        point, normal = pose_of(kin, c)
        total += MODEL.jacobian(kin, int(SURFACE.link[c]), point)[:3].T @ (-size * normal)
    return total


def said(
    kin: Kinematics, torque: FloatArray, obstacles: Obstacles | None = None, cues: Cues | None = None, steps: int = 1,
    ratio: float = 5.0, p: LocalisationParams = P, state: LocalisationState | None = None,
) -> tuple[Touched, LocalisationState]:  # fmt: skip
    tested = zeros(SampleTest, n=N, W=len(LENGTHS))
    tested.means[:], tested.covariance[:], tested.model_variance[:] = torque, NOISE + np.diag(MODEL_VARIANCE), 1e-4
    tested.samples[0], tested.log_likelihood_ratio[0] = 32, ratio
    felt, state = sample(kin, standing(MODEL, torque), obstacles or no_obstacles(), 0.0), state or NO_CONTACT
    for _ in range(steps):
        state = localise(state, BODY, felt, cues or no_cues(len(MODEL.links)), tested, p)
    return state.touched, state


def of(name: str, kin: Kinematics) -> int:
    """Return a candidate in the middle of a link that nothing hides."""
    own = np.flatnonzero((SURFACE.link == MODEL.link_index(name)) & exposed(kin))
    return int(own[len(own) // 2])


PATCH = TouchPatch()


def touched(kin: Kinematics, c: int) -> Cues:
    """What a unit at a candidate says while it is touched, as `touch_cues` has it."""
    link, gain = SURFACE.link[c], np.ones(len(MODEL.links))
    share = np.array([np.pi * PATCH.radius_m**2 / surface_areas(MODEL.capsules, len(MODEL.links))[link]])
    gain[link] = gain_of(share, TouchSensorParams())[0]
    return Cues(gain, np.array([link]), pose_of(kin, c)[0][None], np.array([PATCH.radius_m / 2]))


def prior(kin: Kinematics, cues: Cues, hidden: FloatArray, near: Obstacles | None = None) -> FloatArray:
    """Probability (N,) of each candidate before torques are looked at."""
    ln = np.empty(len(SURFACE.link))
    log_prior(poses(kin)[0], SURFACE, hidden, near or no_obstacles(), cues, NUMBERS, ln)
    return np.exp(ln)


def candidates(torque: FloatArray, kin: Kinematics, numbers: LocalisationParams = NUMBERS) -> Candidates:
    none = np.zeros(len(SURFACE.link))
    return Candidates(torque, kin, MODEL.moved_by, SURFACE, *poses(kin), none, numbers)


def test_candidates_lie_on_the_capsules_and_stand_for_their_area():
    body = MODEL.body
    for c in range(0, len(SURFACE.link), 7):
        own = body.of_links(SURFACE.link[c : c + 1])
        axis = own.b - own.a
        part = np.clip(((SURFACE.point[c] - own.a) * axis).sum(axis=1) / (axis**2).sum(axis=1), 0, 1)
        gap = np.linalg.norm(SURFACE.point[c] - own.a - part[:, None] * axis, axis=1) - own.radius
        assert np.abs(gap).min() < 1e-9
    assert_allclose(np.linalg.norm(SURFACE.normal, axis=1), 1.0)
    # one capsule alone: 2 pi r (l + 2 r)
    link4 = body.of_links(np.array([MODEL.link_index("panda_link4")]))
    length = np.linalg.norm(link4.b - link4.a, axis=1)
    whole = (2 * np.pi * link4.radius * (length + 2 * link4.radius)).sum()
    assert 0.5 * whole < SURFACE.area[SURFACE.link == MODEL.link_index("panda_link4")].sum() < whole


def test_the_likelihood_is_that_of_a_normal_distribution_with_the_force_integrated_out():
    # with many degrees of freedom, and a force whose size is known, it is N(tau; 0, S + J^T V J)
    kin, c = posture(), of("panda_link6", posture())
    point, normal = pose_of(kin, c)
    torque = torques(kin, (c, 30.0))
    ln, force = np.empty(len(SURFACE.link)), np.empty((len(SURFACE.link), 3))
    known = NUMBERS._replace(friction=0.25, force_n=1000.0, tails=1e9)
    assert log_posterior(NOISE, candidates(torque, kin, known), ln, force)
    assert_allclose(force[c], -30.0 * normal, atol=0.5)
    size = -force[c] @ normal
    J = MODEL.jacobian(kin, int(SURFACE.link[c]), point)[:3]
    V = 1000.0**2 * np.outer(normal, normal) + (0.25 * size) ** 2 * (np.eye(3) - np.outer(normal, normal))
    whole = NOISE + J.T @ V @ J
    # only a push is allowed: twice the density
    expected = np.log(2.0) - 0.5 * torque @ np.linalg.solve(whole, torque)
    expected -= 0.5 * np.linalg.slogdet(whole)[1]
    assert ln[c] == pytest.approx(expected, abs=0.02)


def test_torques_whose_covariance_is_none_say_nothing():
    kin, ln = posture(), np.zeros(len(SURFACE.link))
    assert not log_posterior(-NOISE, candidates(np.zeros(N), kin), ln, np.zeros((len(SURFACE.link), 3)))
    assert not ln.any()


@pytest.mark.parametrize("link", ["panda_link5", "panda_link6", "panda_link7", "panda_hand"])
@pytest.mark.parametrize("seed", range(3))
def test_a_contact_on_an_outer_link_is_found_where_it_is(link, seed):
    kin = posture(seed)
    c = of(link, kin)
    found, _ = said(kin, torques(kin, (c, 40.0)), steps=4)
    point, normal = pose_of(kin, c)
    assert len(found.link) == 1
    assert MODEL.rigid[found.link[0]] == SURFACE.body[c]
    assert np.linalg.norm(found.point[0] - point) < 0.03
    assert found.force[0] @ -normal > 30.0
    assert found.probability[0] > 0.9


def test_a_force_line_that_crosses_the_body_twice_is_taken_where_it_pushes_inwards():
    kin = posture(1)
    c = of("panda_hand", kin)
    point, normal = pose_of(kin, c)
    found, _ = said(kin, torques(kin, (c, 40.0)))
    other, _ = said(kin, -torques(kin, (c, 40.0)))
    assert found.force[0] @ normal < 0 < other.force[0] @ normal
    assert np.linalg.norm(found.point[0] - point) < np.linalg.norm(other.point[0] - point)


def test_nothing_is_said_while_nothing_is_felt_and_nothing_is_remembered_afterwards():
    kin = posture()
    torque = torques(kin, (of("panda_hand", kin), 40.0))
    found, state = said(kin, torque, ratio=0.9)
    assert not len(found.link)
    assert state.steps == 0
    found, state = said(kin, torque)
    assert len(found.link) == 1
    assert said(kin, torque, ratio=0.6, state=state)[1].steps == 2  # it goes on below the ratio it began with
    found, state = said(kin, torque, ratio=0.4, state=state)
    assert not len(found.link)
    assert not len(state.ln)


def test_a_touched_unit_and_a_seen_hand_say_where_when_the_torques_do_not():
    kin = posture()
    c = of("panda_link2", kin)
    point, normal = pose_of(kin, c)
    torque = torques(kin, (c, 60.0))
    alone, _ = said(kin, torque)
    told, _ = said(kin, torque, cues=touched(kin, c)._replace(gain=np.ones(len(MODEL.links))))
    seen, _ = said(kin, torque, obstacles=something(int(SURFACE.link[c]), point, normal, 0.05, 1.0))
    assert MODEL.rigid[told.link[0]] == SURFACE.body[c]
    assert np.linalg.norm(told.point[0] - point) < 0.02
    assert np.linalg.norm(seen.point[0] - point) < 0.06
    assert told.sigma[0] < alone.sigma[0]
    # and a link that units call likely more is believed
    gain = np.ones(len(MODEL.links))
    gain[SURFACE.link[c]] = 100.0
    likely, _ = said(kin, torque, cues=no_cues(len(MODEL.links))._replace(gain=gain))
    assert MODEL.rigid[likely.link[0]] == SURFACE.body[c]


def test_the_prior_is_one_in_all_and_hides_what_cannot_be_touched():
    kin = posture()
    point, _ = poses(kin)
    hidden = ~exposed(kin)
    assert 0 < hidden.sum() < len(SURFACE.link) / 2
    near = no_obstacles(2)._replace(point=point[:2] + 0.03, body_distance=np.array([0.03, 0.2]))
    made = prior(kin, no_cues(len(MODEL.links)), hidden, near)
    assert made.sum() == pytest.approx(1.0, abs=1e-6)
    assert made[hidden].max() < 1e-11


def test_between_two_inferences_the_last_one_holds():
    kin = posture()
    torque = torques(kin, (of("panda_hand", kin), 40.0))
    slow = replace(P, update_s=0.05)
    first, state = said(kin, torque, p=slow)
    second, state = said(kin, 2.0 * torque, p=slow, state=state)
    assert second is first
    later, _ = said(kin, 2.0 * torque, p=slow, state=state, steps=4)
    assert later is not first


def noisy(torque: FloatArray, seed: int) -> FloatArray:
    noise = np.random.default_rng(seed).standard_normal(N)
    return np.asarray(torque + np.linalg.cholesky(NOISE / 16 + np.diag(MODEL_VARIANCE)) @ noise)


@pytest.mark.parametrize(("link", "most"), [("panda_link1", 0.9), ("panda_link2", 0.7), ("panda_link3", 0.9)])
def test_a_touch_tells_the_place_on_links_of_which_torques_tell_little(link, most):
    kin, rng, right, told_off, alone_off = posture(3), np.random.default_rng(4), 0, [], []
    own = np.flatnonzero((SURFACE.link == MODEL.link_index(link)) & exposed(kin))
    for seed, c in enumerate(rng.choice(own, 12)):
        point, _ = pose_of(kin, int(c))
        torque = noisy(torques(kin, (int(c), 30.0)), seed)
        alone, _ = said(kin, torque)
        told, _ = said(kin, torque, cues=touched(kin, int(c)))
        assert MODEL.rigid[told.link[0]] == SURFACE.body[c]
        right += MODEL.rigid[alone.link[0]] == SURFACE.body[c]
        told_off.append(np.linalg.norm(told.point[0] - point))
        alone_off.append(np.linalg.norm(alone.point[0] - point))
    assert right <= most * 12
    assert max(told_off) < 0.03
    assert np.median(told_off) < 0.3 * np.median(alone_off)


OUTER = [int(SURFACE.body[SURFACE.link == MODEL.link_index(f"panda_{name}")][0]) for name in ("link5", "link6", "hand")]


@examples(60)
@given(st.integers(0, 10_000), st.sampled_from(OUTER), st.integers(0, 10_000), st.integers(0, 10_000),
       st.sampled_from([20.0, 30.0, 60.0]))  # fmt: skip
def test_torques_that_contradict_a_false_touch_win(seed, where, one, other, newtons):
    kin = posture(seed)
    free = np.flatnonzero(exposed(kin))
    own = free[SURFACE.body[free] == where]
    c, false = int(own[one % len(own)]), int(free[other % len(free)])
    point, _ = pose_of(kin, c)
    assume(np.linalg.norm(pose_of(kin, false)[0] - point) > 0.08)
    torque = noisy(torques(kin, (c, newtons)), seed)
    alone, _ = said(kin, torque, steps=3)
    # what contradicts the touch: the torques alone are sure of the right body, and of where on it
    assume(len(alone.link) == 1 and MODEL.rigid[alone.link[0]] == where and alone.probability[0] > 0.99)
    assume(np.linalg.norm(alone.point[0] - point) < 0.03 and alone.sigma[0] < 0.02)
    told, _ = said(kin, torque, cues=touched(kin, false), steps=3)
    assert len(told.link) == 1
    assert MODEL.rigid[told.link[0]] == where
    assert np.linalg.norm(told.point[0] - point) < 0.04


def test_a_touch_is_counted_once_by_its_place_and_not_by_its_link_again():
    kin = posture()
    hidden, c = ~exposed(kin), of("panda_link4", posture())
    cues = touched(kin, c)
    assert cues.gain[SURFACE.link[c]] > 10.0
    made = prior(kin, cues, hidden)
    near = (SURFACE.link == SURFACE.link[c]) & (made > 1e-3)
    # five in a hundred are left for a false touch: spread over the arm as its surface is, as if no unit spoke
    assert made.sum() == pytest.approx(1.0, abs=1e-6)
    assert made[near].sum() == pytest.approx(0.95, abs=0.01)
    others = ~hidden & (SURFACE.link != SURFACE.link[c])
    whole = SURFACE.area[~hidden].sum()
    assert made[others].sum() == pytest.approx(0.05 * SURFACE.area[others].sum() / whole, rel=1e-6)


def test_a_touch_whose_place_is_hidden_still_counts_by_its_link():
    kin = posture()
    c = of("panda_link4", kin)
    link = SURFACE.link[c]
    cues = touched(kin, c)
    far = cues._replace(point=cues.point + 5.0)
    made = prior(kin, far, ~exposed(kin))
    evenly = prior(kin, far._replace(gain=np.ones(len(cues.gain))), ~exposed(kin))
    on = SURFACE.link == link
    odds = made[on].sum() / made[~on].sum() / (evenly[on].sum() / evenly[~on].sum())
    assert odds == pytest.approx(cues.gain[link], rel=1e-3)


@pytest.mark.slow
def test_a_false_touch_takes_few_pushes_on_link_2_that_the_torques_put_there():
    # two torques contradict little; counted by the gain of its link too, a false touch takes a quarter of them
    lost = right = 0
    rng = np.random.default_rng(5)
    for seed in range(120):
        kin = posture(seed)
        free = np.flatnonzero(exposed(kin))
        c = int(rng.choice(free[SURFACE.link[free] == MODEL.link_index("panda_link2")]))
        false = int(rng.choice(free[SURFACE.link[free] != SURFACE.link[c]]))
        torque = noisy(torques(kin, (c, 40.0)), seed)
        alone, _ = said(kin, torque)
        if MODEL.rigid[alone.link[0]] == SURFACE.body[c]:
            told, _ = said(kin, torque, cues=touched(kin, false))
            right, lost = right + 1, lost + (MODEL.rigid[told.link[0]] != SURFACE.body[c])
    assert right >= 60
    assert lost <= right / 8
