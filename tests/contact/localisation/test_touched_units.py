"""Units that say that they are touched: they tell where a contact is, and false ones do not talk torques down."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.contact.localisation.arm import (
    MODEL,
    MODEL_VARIANCE,
    NOISE,
    SURFACE,
    N,
    P,
    exposed,
    of,
    pose_of,
    poses,
    posture,
    said,
    torques,
)

from pretouch.contact.cues import Cues
from pretouch.contact.localisation.prior import LocalisationNumbers, SeenNear, UnitCues, log_prior
from pretouch.contact.tactile import gain_of, surface_area
from pretouch.params import TouchSensorParams
from pretouch.robot.model import Kinematics
from pretouch.sensing.unit import TouchPatch
from pretouch.types import FloatArray

PATCH = TouchPatch()
SIGMA_M = PATCH.radius / 2


def touched(kin: Kinematics, c: int) -> Cues:
    """What a unit at a candidate says while it is touched, as `TouchSensors` has it."""
    link, gain = SURFACE.link[c], np.ones(len(MODEL.links))
    share = np.array([np.pi * PATCH.radius**2 / surface_area(MODEL.capsules, int(link))])
    gain[link] = gain_of(share, TouchSensorParams())[0]
    return Cues(gain, np.array([link]), pose_of(kin, c)[0][None], np.array([SIGMA_M]), np.array([5.0]))


def body(link: int) -> int:
    return int(MODEL.rigid[link])


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
        assert body(told.link[0]) == SURFACE.body[c]
        right += body(alone.link[0]) == SURFACE.body[c]
        told_off.append(np.linalg.norm(told.point[0] - point))
        alone_off.append(np.linalg.norm(alone.point[0] - point))
    assert right <= most * 12
    assert max(told_off) < 0.03
    assert np.median(told_off) < 0.3 * np.median(alone_off)


OUTER = [int(SURFACE.body[SURFACE.link == MODEL.link_index(f"panda_{name}")][0]) for name in ("link5", "link6", "hand")]


@settings(max_examples=60, deadline=None)
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
    assume(len(alone.link) == 1 and body(alone.link[0]) == where and alone.probability[0] > 0.99)
    assume(np.linalg.norm(alone.point[0] - point) < 0.03 and alone.sigma[0] < 0.02)
    told, _ = said(kin, torque, cues=touched(kin, false), steps=3)
    assert len(told.link) == 1
    assert body(told.link[0]) == where
    assert np.linalg.norm(told.point[0] - point) < 0.04


def prior(kin: Kinematics, cues: Cues, hidden: FloatArray) -> FloatArray:
    """Probability (N,) of each candidate before torques are looked at, nothing being seen."""
    ln, numbers = (
        np.empty(len(SURFACE)),
        LocalisationNumbers(*(getattr(P, name) for name in LocalisationNumbers._fields)),
    )
    log_prior(
        poses(kin)[0], SURFACE.arrays, hidden, SeenNear(np.zeros((0, 3)), np.zeros(0)),
        UnitCues(cues.gain, cues.link, cues.point, cues.sigma), numbers, ln,
    )  # fmt: skip
    return np.exp(ln)


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
    far = Cues(cues.gain, cues.link, cues.point + 5.0, cues.sigma, cues.force)
    made = prior(kin, far, ~exposed(kin))
    evenly = prior(kin, Cues(np.ones(len(cues.gain)), *(getattr(far, n) for n in ("link", "point", "sigma", "force"))),
                   ~exposed(kin))  # fmt: skip
    on = SURFACE.link == link
    odds = made[on].sum() / made[~on].sum() / (evenly[on].sum() / evenly[~on].sum())
    assert odds == pytest.approx(cues.gain[link], rel=1e-3)


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
        if body(alone.link[0]) == SURFACE.body[c]:
            told, _ = said(kin, torque, cues=touched(kin, false))
            right, lost = right + 1, lost + (body(told.link[0]) != SURFACE.body[c])
    assert right >= 60
    assert lost <= right / 8
