"""The localisation benchmark: its motion, its contacts, the limit of what torques tell, and what rows say."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pretouch.types import NOT_TOUCHED, RobotState, Touched
from pretouch_lab.bench import localization
from pretouch_lab.bench.contacts import Touching
from pretouch_lab.bench.localization import LINK_M, name_of, planned, plays, replayed, results, rows_of, tables, trial
from pretouch_lab.bench.motions import wandering
from pretouch_lab.bench.scenes import model

LEARNT = np.stack([np.stack([np.full(7, 0.25), np.full(7, 0.01)])] * 2)
READY = model().description.q_ready


def touching(link: str, force: float = 20.0) -> Touching:
    arm = model()
    index = arm.link_index(f"panda_{link}")
    c = int(np.flatnonzero(arm.surface.link == index)[0])
    point, normal = arm.surface.point[c], arm.surface.normal[c]
    return Touching(index, 0, force, 0.02, 0.4, 1.0, point, normal, -normal, 0.05)


def at(link: int, place: np.ndarray) -> Touched:
    return Touched(np.array([link]), place[None], np.ones((1, 3)), np.ones(1), np.ones(1))


def true_place(touch: Touching) -> np.ndarray:
    kin = model().kinematics(READY)
    return kin.position[touch.link] + kin.rotation[touch.link] @ touch.point


@pytest.fixture
def replay(monkeypatch: pytest.MonkeyPatch):
    """Replay a contact from 1.0 to 1.4 s, of which the detector says a thing every 0.1 s from the beginning on."""

    def replay(touch: Touching, *touched: Touched) -> dict:
        none, answers = np.zeros(7), [*touched, NOT_TOUCHED]
        robots = [RobotState(1.0 + 0.1 * k, READY, none, READY, none, none, None) for k in range(len(answers))]
        stream = SimpleNamespace(steps=lambda: [(robot, localization.NOTHING, False, True) for robot in robots])
        learnt = SimpleNamespace(test=SimpleNamespace(model=SimpleNamespace(spread=LEARNT)))
        alone = SimpleNamespace(state=learnt, step=lambda *_: SimpleNamespace(touched=answers.pop(0)))
        monkeypatch.setattr(localization, "DetectorAlone", lambda *_: alone)
        return replayed(stream, [touch], "none")

    return replay


def test_the_arm_wanders_from_rest_to_rest_within_its_limits():
    course, times = wandering(1000, 60.0), np.arange(0.0, 60.0, 0.01)
    q, qd = (np.array(part) for part in zip(*(course.at(t) for t in times), strict=True))
    assert ((q >= model().q_min) & (q <= model().q_max)).all()
    assert_allclose(np.gradient(q, times, axis=0)[1:-1], qd[1:-1], atol=0.01)
    assert 0.2 < np.abs(qd).max() <= 0.61
    assert (np.abs(qd).max(axis=1) == 0.0).mean() > 0.1  # it rests
    assert np.ptp(q, axis=0).min() > 0.3
    assert_allclose(wandering(1000, 60.0).q, course.q)  # the seed says which
    assert np.abs(wandering(1001, 60.0).q[0] - course.q[0]).max() > 0.1


def test_contacts_are_those_of_the_goals_and_links_that_the_same_joints_move_are_one_body():
    _, touches = planned(1000)
    assert len(touches) == 40
    assert all(touch.force_n >= 15.0 and touch.duration_s >= 0.1 for touch in touches)
    assert len({touch.link for touch in touches}) == 8
    names = [name_of(model().link_index(f"panda_{link}")) for link in ("link3", "link7", "link8", "hand")]
    assert names == ["link3", "hand", "hand", "hand"]


def test_an_arm_has_the_same_seed_with_each_skin(monkeypatch):
    arms = plays("development", quick=True)
    assert [(cell["sensing"], seed) for cell, seed in arms] == [
        (sensing, seed) for seed in (1000, 1001) for sensing in ("nominal", "seven", "misplaced")
    ]
    monkeypatch.setattr(localization, "streamed", lambda *_: (None, None))
    monkeypatch.setattr(localization, "replayed", lambda *_: {})
    rows = rows_of([cell | {"seed": seed} | trial(cell, seed) for cell, seed in arms])
    assert [row["skin"] for row in rows if row["seed"] == 1000][:3] == ["32 units", "none", "none, nothing learnt"]
    assert len(plays("published", quick=False)) == 24 * 3


def test_a_contact_is_judged_by_its_body_and_its_place_100_ms_after_its_beginning_and_at_its_end(replay):
    touch = touching("link6")
    place = true_place(touch)
    right, wrong = at(touch.link, place + np.array([0.0, 0.03, 0.0])), at(model().ee, place)
    (row,) = replay(touch, NOT_TOUCHED, right, NOT_TOUCHED, NOT_TOUCHED, wrong)["contacts"]
    assert (row["link"], row["right"], row["error_m"]) == ("link6", True, pytest.approx(0.03))
    assert (row["right_end"], row["taken_for_end"], row["error_m_end"]) == (False, "hand", 0.0)
    (missed,) = replay(touch, *[NOT_TOUCHED] * 5)["contacts"]
    assert (missed["detected"], missed["right"], missed["error_m"]) == (False, False, None)


def test_torques_tell_most_of_the_hand_and_hardly_anything_of_the_first_links():
    def limit(link: str, force: float = 30.0) -> float:
        return localization.position_limit(touching(link, force), model().kinematics(READY), READY, LEARNT)

    limits = [limit(link) for link in ("link1", "link2", "link4", "link6", "hand")]
    assert limits[0] > limits[2] > limits[4]
    assert limits[-1] < 0.03
    assert max(limits) <= np.sqrt(2.0) * LINK_M
    assert limit("link6", 60.0) < limit("link6", 15.0), "a harder push tells more"


def test_a_table_has_a_row_for_each_skin_and_body(replay):
    touch = touching("hand")
    near, elsewhere = at(touch.link, true_place(touch) + 0.01), at(touching("link6").link, true_place(touch) + 0.02)
    contacts = [
        contact
        for touched in (near, elsewhere, NOT_TOUCHED)
        for contact in replay(touch, *[touched] * 5)["contacts"]
    ]  # fmt: skip
    (row,) = results([{"skin": "none", "contacts": contacts, "median_s": 0.0004, "p99_s": 0.002}])
    (table,) = tables([row])
    # distances of 17.3 and 34.6 mm, of which the 90 % quantile is 32.9 mm
    assert table.rows[0][:8] == ("none", "hand", "3", "2", "33", "link6 1", "2.6", "3.3")
    assert "none 500 Hz" in table.note
