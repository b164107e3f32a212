"""The localisation benchmark: its motion, its contacts, the limit of what torques tell, and what rows say."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pretouch.types import NOT_TOUCHED, Touched
from pretouch_lab.bench.contacts import Touching
from pretouch_lab.bench.localization import Said, _one, name_of, planned, plays, results, stream_plays, tables
from pretouch_lab.bench.localization_limit import LINK_M, position_limit
from pretouch_lab.bench.motions import wandering
from pretouch_lab.bench.scenes import model

LEARNT = np.stack([np.stack([np.full(7, 0.25), np.full(7, 0.01)])] * 2)


def touching(link: str, start: float = 1.0, force: float = 20.0) -> Touching:
    arm = model()
    index = arm.link_index(f"panda_{link}")
    c = int(np.flatnonzero(arm.surface.link == index)[0])
    point, normal = arm.surface.point[c], arm.surface.normal[c]
    return Touching(index, 0, force, 0.02, 0.4, start, point, normal, -normal)


def said_at(link: int, place: np.ndarray) -> Touched:
    return Touched(np.array([link]), place[None], np.ones((1, 3)), np.ones(1), np.ones(1))


def said_of(*touched: Touched) -> Said:
    count = len(touched)
    q = np.tile(model().description.q_ready, (count, 1))
    return Said(1.0 + 0.1 * np.arange(count), list(touched), q, np.tile(LEARNT, (count, 1, 1, 1)), np.zeros(0))


def true_place(touch: Touching) -> np.ndarray:
    kin = model().kinematics(model().description.q_ready)
    return kin.position[touch.link] + kin.rotation[touch.link] @ touch.point


def within_limits(course, until: float, atol: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of a course at 100 Hz, which stays within the arm's limits and goes as it tells."""
    arm, times = model(), np.arange(0.0, until, 0.01)
    q, qd = (np.array(part) for part in zip(*(course.at(t) for t in times), strict=True))
    assert (q >= arm.q_min).all()
    assert (q <= arm.q_max).all()
    assert_allclose(np.gradient(q, times, axis=0)[1:-1], qd[1:-1], atol=atol)
    return q, qd


def test_the_arm_wanders_from_rest_to_rest_within_its_limits():
    course = wandering(1000, 60.0)
    q, qd = within_limits(course, 60.0, 0.01)
    assert 0.2 < np.abs(qd).max() <= 0.61
    assert (np.abs(qd).max(axis=1) == 0.0).mean() > 0.1  # it rests
    assert np.ptp(q, axis=0).min() > 0.3
    assert_allclose(wandering(1000, 60.0).q, course.q)  # the seed says which
    assert np.abs(wandering(1001, 60.0).q[0] - course.q[0]).max() > 0.1


def test_contacts_are_those_of_the_goals():
    _, hand = planned(1000)
    assert len(hand) == 40
    assert min(touch.force_n for touch in hand) >= 15.0
    assert min(touch.duration_s for touch in hand) >= 0.1
    assert len({touch.link for touch in hand}) == 8


def test_an_arm_has_the_same_seed_with_each_skin():
    streams = stream_plays("development", quick=True)
    assert [(cell["sensing"], seed) for cell, seed in streams] == [
        (sensing, seed) for seed in (1000, 1001) for sensing in ("nominal", "seven", "misplaced")
    ]
    assert [cell["skin"] for cell, seed in plays(streams) if seed == 1000][:3] == [
        "32 units",
        "none",
        "none, nothing learnt",
    ]
    assert len(stream_plays("published", quick=False)) == 24 * 3


def test_links_that_the_same_joints_move_are_one_body():
    names = [name_of(model().link_index(f"panda_{link}")) for link in ("link3", "link7", "link8", "hand")]
    assert names == ["link3", "hand", "hand", "hand"]


def test_a_contact_is_judged_by_its_body_and_its_place():
    touch = touching("link6")
    at = true_place(touch)
    right, wrong = said_at(touch.link, at + np.array([0.0, 0.03, 0.0])), said_at(model().ee, at)
    row = _one(touch, said_of(NOT_TOUCHED, right, NOT_TOUCHED, NOT_TOUCHED, wrong))
    assert row["right"]
    assert row["error_m"] == pytest.approx(0.03)
    assert not row["right_end"]
    assert row["taken_for_end"] == "hand"
    assert row["error_end_m"] == 0.0
    missed = _one(touch, said_of(NOT_TOUCHED, NOT_TOUCHED))
    assert (missed["detected"], missed["right"], missed["error_m"]) == (False, False, None)


def test_torques_tell_most_of_the_hand_and_hardly_anything_of_the_first_links():
    q = model().description.q_ready
    kin = model().kinematics(q)

    def limit(link: str, force: float = 30.0) -> float:
        return position_limit(touching(link, force=force), kin, q, LEARNT)

    limits = [limit(link) for link in ("link1", "link2", "link4", "link6", "hand")]
    assert limits[0] > limits[2] > limits[4]
    assert limits[-1] < 0.03
    assert max(limits) <= np.sqrt(2.0) * LINK_M
    assert limit("link6", 60.0) < limit("link6", 15.0), "a harder push tells more"


def test_rows_say_what_was_found():
    touch = touching("hand")
    at = said_at(touch.link, true_place(touch) + 0.01)
    found = [_one(touch, said_of(NOT_TOUCHED, at, at, at, at)), _one(touch, said_of(NOT_TOUCHED))]
    rows = results([{"skin": "none", "found": found, "median_s": 0.0004, "p99_s": 0.002}])
    (first,) = rows
    assert first["link"] == "hand"
    assert (first["skin"], first["contacts"], first["detected"], first["right_link"]) == ("none", 2, 1, 0.5)
    assert first["median_error_m"] == pytest.approx(0.0173, abs=1e-4)
    assert first["rate_hz"] == 500.0
    (table,) = tables(rows)
    assert table.rows[0][:4] == ("none", "hand", "2", "1")
