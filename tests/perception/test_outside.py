"""Points of outside sources: which become obstacles, where, for how long, and what their silence does."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.examples import examples
from tests.perception.watcher import FLOOR, TCP, readings_of
from tests.perception.watcher import Watcher as Eyes

from pretouch.params import LocalMapParams, OutsidePoints, PerceptionParams
from pretouch.perception.closest import closest_points
from pretouch.perception.external_points import outside_silence
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.body import placed
from pretouch.robot.description import panda
from pretouch.sensing.skin import paper_skin
from pretouch.types import SeenPoints

UNITS = 7
PARAMS = PerceptionParams(memory=LocalMapParams(), outside=OutsidePoints())
POINTS = OutsidePoints()


def points_at(stamp: float, *point, sigma: float = 0.0) -> SeenPoints:
    at = np.array(point, dtype=np.float64).reshape(-1, 3)
    return SeenPoints(stamp, np.full(len(at), stamp), at, np.full(len(at), sigma))


class Watcher(Eyes):
    """Perception of outside points alone, its state carried along."""

    def __init__(self, model, params=PARAMS, fixtures=None):
        super().__init__(model, paper_skin(model), fixtures or no_fixtures(), params)
        self.pose(panda().q_ready)

    @property
    def heard(self):
        return self.memory.get("source_stamp")

    def pose(self, q):
        self.q, self.kin = q, self.model.kinematics(q)

    def see(self, now: float, points: SeenPoints | None):
        return self.take(readings_of(self.skin, now), now, points=points)


@pytest.fixture
def watcher(panda_model):
    return Watcher(panda_model)


BESIDE = TCP + np.array([0.0, 0.4, 0.0])


def test_a_point_is_an_obstacle_at_its_distance_less_two_sigmas(watcher):
    near = watcher.see(1.0, points_at(1.0, BESIDE, sigma=0.01))
    exact = closest_points(watcher.kin, watcher.model.body, TCP, np.zeros(1, int), BESIDE[None], np.eye(3)[:1])
    assert near.unit.tolist() == [UNITS]
    assert watcher.model.parts[near.slot[0] // PARAMS.memory.per_link] == near.link[0]
    assert near.point == pytest.approx(BESIDE[None])
    assert near.body_distance == pytest.approx(exact.body_distance - 0.02)
    assert near.ee_distance == pytest.approx([0.4 - 0.02], abs=1e-5)
    assert near.direction == pytest.approx(exact.direction)
    assert near.link.tolist() == exact.link.tolist()


def on_the_arm(model, q, count: int = 400):
    """Points on the surface of the arm's capsules in a posture, base included."""
    rng, (_, a, b, _) = np.random.default_rng(5), placed(model.capsules, model.kinematics(q))
    which, along = rng.integers(0, len(a), count), rng.uniform(0, 1, count)[:, None]
    out = rng.standard_normal((count, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    return a[which] + along * (b - a)[which] + model.capsules.radius[which, None] * out


def test_what_shows_the_arm_itself_is_no_obstacle(watcher):
    assert len(watcher.see(1.0, points_at(1.0, on_the_arm(watcher.model, watcher.q))).unit) == 0


def test_the_arm_is_left_out_where_it_was_when_the_points_were_measured(panda_model):
    qd, late = np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 0.13
    q = panda().q_ready
    before = on_the_arm(panda_model, q - late * qd)
    moving, unaware = Watcher(panda_model), Watcher(panda_model)
    moving.qd = qd
    seen = points_at(1.0 - late, before)
    assert len(moving.see(1.0, seen).unit) == 0
    assert len(unaware.see(1.0, seen).unit) > 0, "from where the arm is now, it would be taken for an obstacle"


def test_fixtures_are_left_out_up_to_the_margin_and_the_uncertainty(panda_model):
    for height, sigma, seen in ((0.04, 0.0, 0), (0.06, 0.0, 1), (0.06, 0.01, 0), (-0.3, 0.0, 0)):
        watcher = Watcher(panda_model, fixtures=FLOOR)
        assert len(watcher.see(1.0, points_at(1.0, [0.7, 0.3, height - 0.2], sigma=sigma)).unit) == seen


@pytest.mark.parametrize(
    "spoil",
    [
        lambda s: s._replace(point=s.point * np.nan),
        lambda s: s._replace(point=s.point * np.inf),
        lambda s: s._replace(point=s.point * 1000),
        lambda s: s._replace(sigma=-s.sigma - 0.01),
        lambda s: s._replace(sigma=s.sigma * np.nan),
        lambda s: s._replace(sigma=s.sigma + 2.0),
        lambda s: s._replace(stamp=s.stamp + 0.2),
        lambda s: s._replace(stamp=s.stamp - 0.2),
        lambda s: s._replace(stamp=s.stamp * np.nan),
    ],
)
def test_a_point_that_is_none_is_left_out_and_the_others_stay(watcher, spoil):
    one = points_at(1.0, BESIDE)
    bad = spoil(points_at(1.0, TCP - np.array([0.0, 0.3, 0.0])))
    both = SeenPoints(
        1.0, *(np.concatenate((getattr(bad, name), getattr(one, name))) for name in ("stamp", "point", "sigma"))
    )
    assert watcher.see(1.0, both).point == pytest.approx(BESIDE[None])


@given(st.integers(0, 2**32 - 1), st.integers(0, 300))
@examples(30, least=10)
def test_of_any_points_each_link_keeps_the_nearest_ones_in_different_directions(panda_model, seed, count):
    rng = np.random.default_rng(seed)
    points = rng.uniform([-0.8, -0.8, 0.0], [1.0, 0.8, 1.2], (count, 3))
    # one for each cell of the widest looks: of several in a cell one is remembered
    points = points[np.unique(np.floor(points / (4 * PARAMS.memory.cell_m)), axis=0, return_index=True)[1]]
    count, watcher = len(points), Watcher(panda_model)
    u = 2 * rng.uniform(0.0, 0.02, count)
    near = watcher.see(1.0, SeenPoints(1.0, np.full(count, 1.0), points, u / 2))
    aside = np.tile([0.0, 0.0, 1.0], (count, 1))
    all_of_them = closest_points(watcher.kin, panda_model.body, TCP, np.zeros(count, int), points, aside)
    _, a, b, _ = placed(panda_model.capsules, watcher.kin)
    along = ((points[:, None] - a) * (b - a)).sum(2) / np.maximum(((b - a) ** 2).sum(1), 1e-12)
    feet = a + np.clip(along, 0.0, 1.0)[..., None] * (b - a)
    gap = (np.linalg.norm(points[:, None] - feet, axis=2) - panda_model.capsules.radius).min(axis=1, initial=np.inf)
    lower = all_of_them.body_distance - u
    counts = (gap > POINTS.margin_m + u) & (lower < PARAMS.memory.mark_m)
    for link in panda_model.parts:
        chosen: list[int] = []
        for m in np.argsort(lower):
            apart = all(all_of_them.direction[m] @ all_of_them.direction[c] <= np.cos(np.deg2rad(30)) for c in chosen)
            if counts[m] and all_of_them.link[m] == link and apart and len(chosen) < PARAMS.memory.per_link:
                chosen.append(m)
        np.testing.assert_allclose(near.body_distance[near.link == link], lower[chosen], atol=1e-12)
        np.testing.assert_array_equal(near.point[near.link == link], points[chosen])
    assert len(set(near.slot.tolist())) == len(near.slot)


def test_a_point_lasts_until_its_source_shows_it_gone_or_counts_as_silent(panda_model):
    silent, answering = Watcher(panda_model), Watcher(panda_model)
    for watcher in (silent, answering):
        watcher.see(1.0, points_at(1.0, BESIDE))
    assert len(silent.see(1.39, None).unit) == 1, "a silent source does not say that it is gone"
    assert len(silent.see(1.41, None).unit) == 0
    assert len(answering.see(1.1, points_at(1.1)).unit) == 1, "one frame without it removes nothing"
    assert len(answering.see(1.149, None).unit) == 1
    assert len(answering.see(1.16, points_at(1.16)).unit) == 0


def test_what_the_arm_comes_to_is_not_forgotten_for_being_taken_for_the_arm(panda_model):
    side = TCP + np.array([0.0, 0.2, 0.06])
    for hidden, kept in ((3.0, True), (0.0, False)):
        watcher = Watcher(panda_model, replace(PARAMS, outside=OutsidePoints(hidden_s=hidden)))
        (gap,) = watcher.see(1.0, points_at(1.0, side)).body_distance
        assert gap > POINTS.margin_m
        # the arm turns about its base until the point is within the margin, where the source tells nothing of it
        turned = watcher.q.copy()
        turned[0] += (gap - 0.03) / np.linalg.norm(side[:2])
        watcher.pose(turned)
        seen = [watcher.see(now, points_at(now, side)) for now in np.arange(1.03, 3.9, 0.03)]
        assert [len(near.unit) == 1 for near in seen[6:]] == [kept] * len(seen[6:])
        if kept:
            assert 0.0 < seen[-1].body_distance[0] < POINTS.margin_m
        last = [watcher.see(now, points_at(now)) for now in np.arange(3.9, 4.5, 0.03)]
        assert len(last[-1].unit) == 0, "not for ever"


def test_a_point_in_the_air_that_is_gone_is_not_kept_for_the_arm_once_it_leaves(panda_model):
    watcher = Watcher(panda_model)
    side = TCP + np.array([0.0, 0.2, 0.06])
    watcher.see(1.0, points_at(1.0, side))
    for now in np.arange(1.03, 1.5, 0.03):
        near = watcher.see(now, points_at(now))
    assert len(near.unit) == 0


@pytest.mark.parametrize("spread", [0.0, 0.05])
@pytest.mark.parametrize("speed", [-0.3, 0.0, 0.5])
def test_the_own_speed_of_what_is_seen_is_known(panda_model, speed, spread):
    watcher = Watcher(panda_model)
    hand = BESIDE + np.random.default_rng(2).uniform(0.0, spread, (40, 3))
    for k in range(20):
        now = 1.0 + k / 30
        near = watcher.see(now, points_at(now, *(hand - [0.0, speed * k / 30, 0.0])))
    nearest = np.argmin(near.body_distance)
    assert near.closing_speed[nearest] == pytest.approx(speed * near.direction[nearest, 1], abs=0.02 + 2 * spread)


def test_a_set_from_the_future_or_from_before_is_not_heard(watcher):
    assert len(watcher.see(0.5, None).unit) == 0
    assert np.isnan(watcher.heard)
    assert len(watcher.see(1.0, points_at(1.5, BESIDE)).unit) == 0
    assert watcher.heard == -np.inf
    watcher.see(1.0, points_at(1.0, BESIDE))
    watcher.see(1.01, points_at(0.9))
    assert watcher.heard == 1.0


def test_a_source_that_falls_silent_slows_the_arm_and_stops_it(watcher):
    watcher.see(1.0, points_at(-np.inf))
    assert outside_silence(watcher.heard, "", 1.0, POINTS) == (0.0, "has not reported yet")
    watcher.see(1.0, points_at(1.0))
    assert outside_silence(watcher.heard, "", 1.2, POINTS) == (1.0, "")
    factor, lost = outside_silence(watcher.heard, "", 1.3, POINTS)
    assert (factor, lost) == (pytest.approx(0.5), "")
    assert outside_silence(watcher.heard, "", 1.41, POINTS) == (0.0, "has been silent for 0.41 s")
    assert outside_silence(watcher.heard, "gives nonsense", 1.0, POINTS) == (0.0, "gives nonsense")
    assert outside_silence(watcher.heard, "gives nonsense", 1.0, None) == (1.0, "")
    assert outside_silence(np.nan, "", 1.0, POINTS) == (1.0, "")
