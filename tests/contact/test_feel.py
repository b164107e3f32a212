"""Detection by each method through its one entry: what is felt, what is learnt and when, and which way the force is."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.contact.alone import begun as feel_init
from tests.contact.alone import feel, something, standing

from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, no_obstacles

MODEL = RobotModel(panda())
KIN = MODEL.kinematics(MODEL.description.q_ready)
PRETOUCH = profile("pretouch:window.samples=10")
UNPLACED = replace(PRETOUCH, detect=replace(PRETOUCH.detect, localise=None))
STILL = np.zeros(7)
NOTHING = no_obstacles()
robot = partial(standing, MODEL)


def object_at(distance: float, direction: np.ndarray) -> Obstacles:
    """One object near the hand's origin, in a direction from it."""
    return something(MODEL.ee, KIN.position[MODEL.ee], direction, distance, distance)


def noise(samples: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((samples, 7)) * np.array([0.5, 0.5, 0.4, 0.4, 0.1, 0.1, 0.1])


def settled(samples: int = 400, p=PRETOUCH, bias: float = 0.3):
    """State after some free motion, all its torques off by the same."""
    state = feel_init(MODEL, p)
    for sample in noise(samples):
        found, state = feel(state, MODEL, KIN, robot(sample + bias), NOTHING, False, p)
        assert found.contact is None
    return state


SETTLED = settled()


def torques(force: np.ndarray) -> np.ndarray:
    return MODEL.ee_jacobian(KIN)[:3].T @ force


@pytest.mark.parametrize("direction", [*np.eye(3), *-np.eye(3)])
def test_a_push_is_a_contact_with_its_direction(direction):
    state, found = SETTLED, None
    for _ in range(5):
        found, state = feel(state, MODEL, KIN, robot(0.3 + torques(20.0 * direction)), NOTHING, False, PRETOUCH)
        if found.contact:
            break
    assert found.contact is not None
    assert found.evidence >= 1.0
    assert found.contact.force @ direction > 0.9 * np.linalg.norm(found.contact.force)


def test_the_residual_is_what_the_mean_leaves():
    found, _ = feel(SETTLED, MODEL, KIN, robot(np.full(7, 0.3)), NOTHING, False, PRETOUCH)
    assert np.abs(found.residual).max() < 0.15  # 0.3 Nm was learnt from 3.7 s
    assert found.thresholds.upper[0] > found.thresholds.mean[0] > found.thresholds.lower[0]


def test_a_seen_object_is_felt_at_a_smaller_force_and_never_yielded_to():
    towards = np.array([0.0, 1.0, 0.0])
    evidence = {}
    for name, sign in (("away", -1.0), ("towards", 1.0), ("nothing", -1.0)):
        near = NOTHING if name == "nothing" else object_at(0.01, towards)._replace(closing_speed=np.array([0.25]))
        found, _ = feel(SETTLED, MODEL, KIN, robot(0.3 + torques(sign * 6.0 * towards)), near, False, PRETOUCH)
        evidence[name] = found.evidence
        if name == "away" and found.contact:
            assert found.contact.force @ towards <= 1e-9
    assert evidence["away"] > evidence["nothing"]
    assert evidence["towards"] <= evidence["away"]


def weights_after(state, samples: int, p=PRETOUCH, near=NOTHING, reacting=False, watched=True, push=None):
    for sample in noise(samples, 2):
        given = robot(sample + 1.0 if push is None else sample + push)
        _, state = feel(state, MODEL, KIN, given, near, reacting, p, watched)
    return state.state.test.model.weights


def test_what_stands_still_counts_as_nobody():
    push, up = robot(0.3 + torques(np.array([0.0, -6.0, 0.0]))), np.array([0.0, 1.0, 0.0])
    for distance in (0.0, 0.11):
        beside, alone = (
            feel(SETTLED, MODEL, KIN, push, n, False, PRETOUCH)[0] for n in (object_at(distance, up), NOTHING)
        )
        assert beside.evidence == alone.evidence


@given(st.floats(-0.05, 0.29), st.floats(0.0, 1.0))
def test_nothing_is_learnt_of_an_object_that_may_touch_in_its_horizon_and_beyond_it_is_learnt(distance, closing):
    before = SETTLED.state.test.model
    near = object_at(distance, np.array([0.0, 0.0, 1.0]))._replace(closing_speed=np.array([closing]))
    # where a contact would be decides nothing of what is learnt, and is most of the time a step takes
    after = weights_after(SETTLED, 45, UNPLACED, near=near)
    # the quantile of 2 % is 2.05 deviations of 0.05 m below the mean
    assert np.array_equal(after, before.weights) == (distance - 0.2 * closing < 2.0537 * 0.05)


@pytest.mark.parametrize(
    "how", [{"reacting": True}, {"watched": False}, {"p": profile("pretouch:window.samples=10:detect.learn=never")}]
)
def test_nothing_is_learnt_while_reacting_unwatched_or_when_told_not_to(how):
    before = SETTLED.state.test.model
    assert_array_equal(weights_after(SETTLED, 60, **how), before.weights)


def test_the_beginning_of_a_contact_counts_for_little():
    push, before = 0.3 + torques(np.array([0.0, 30.0, 0.0])), SETTLED.state.test.model.weights
    calm = weights_after(SETTLED, 60, push=np.full(7, 0.3))
    assert np.abs(calm - before).max() > 0  # free motion goes on being learnt
    assert np.abs(weights_after(SETTLED, 60, push=push) - before).max() <= 0.15


def test_the_window_is_frozen_while_reacting_only_if_the_profile_says_so():
    force = np.array([0.0, 40.0, 0.0, 0.0, 0.0, 0.0])
    for p, moved in ((PRETOUCH, False), (profile("paper:window.samples=10"), True)):
        state = feel_init(MODEL, p)
        for _ in range(12):
            _, state = feel(state, MODEL, KIN, robot(STILL), NOTHING, False, p)
        for _ in range(8):
            _, state = feel(state, MODEL, KIN, robot(STILL, force), NOTHING, True, p)
        assert bool(abs(state.window.mean()[1]) > 1.0) is moved


def test_the_papers_rule_tells_its_evidence_and_passes_torques_on():
    p = profile("paper:window.samples=4:detect.compare=raw")
    state = feel_init(MODEL, p)
    for size in (0.0, 0.0, 0.0, 0.0, 5.0, 40.0):
        given = robot(np.full(7, size), np.array([size, 0.0, 0.0, 0.0, 0.0, 0.0]))
        found, state = feel(state, MODEL, KIN, given, NOTHING, False, p)
        assert (found.contact is not None) is (found.evidence > 1.0)
        assert_allclose(found.residual, size)


def test_the_place_of_a_push_is_told_and_changes_nothing_else_that_is_felt():
    off = profile("pretouch:window.samples=10:detect.localise=none")
    push = 0.3 + torques(np.array([0.0, 25.0, 0.0]))
    one, two, said = SETTLED, settled(p=off), []
    for _ in range(8):
        found, one = feel(one, MODEL, KIN, robot(push), NOTHING, False, PRETOUCH)
        other, two = feel(two, MODEL, KIN, robot(push), NOTHING, False, off)
        assert_array_equal(found.thresholds, other.thresholds)
        assert found.evidence == other.evidence
        assert not len(other.touched.link)
        said.append(found.touched)
    assert len(said[-1].link) == 1
    assert MODEL.rigid[said[-1].link[0]] == MODEL.rigid[MODEL.ee]
    assert said[-1].force[0, 1] > 15.0
    # the state without a switch holds nothing of it; without an estimate of torques the contact is over
    assert two.state.localisation is None
    found, one = feel(one, MODEL, KIN, robot(np.full(7, np.nan)), NOTHING, False, PRETOUCH)
    assert not len(found.touched.link)
    assert one.state.localisation.steps == 0
