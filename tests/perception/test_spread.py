"""Where a unit sits is uncertain: what it shows counts as nearer, and the arm in view is expected earlier."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fuzz.invariants import same
from tests.perception.watcher import FLOOR, PARAMS, Watcher

from pretouch.perception.obstacles import spread
from pretouch.robot.description import panda
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RangeReadings, RangeStatus

BARE = replace(PARAMS, self_margin_m=None)


def unsure(skin: Skin, model, position: float = 0.0, orientation: float = 0.0) -> Skin:
    """The same skin, all its units placed that badly."""
    return Skin([replace(u, position_sigma=position, orientation_sigma=orientation) for u in skin.units], model)


def seen(model, skin: Skin, distances, params=PARAMS) -> Obstacles:
    """What perception makes of one reading of each unit."""
    return look(Watcher(model, skin, FLOOR, params), distances)


def look(watcher: Watcher, distances, now=1.0, stamp=1.0) -> Obstacles:
    """What a watcher makes of one reading of each unit."""
    count = len(watcher.skin)
    distance = np.broadcast_to(np.asarray(distances, dtype=np.float64), count).copy()
    return watcher.take(RangeReadings(np.full(count, stamp), distance, np.full(count, int(RangeStatus.OK))), now)


def test_the_spread_grows_with_the_distance_and_both_uncertainties():
    # legs of 3 and 4 mm, twice
    assert spread(2.0, 0.003, 0.01, 0.4) == pytest.approx(0.01, abs=1e-15)
    assert spread(1.0, 0.003, 0.0, 4.0) == pytest.approx(0.003, abs=1e-15)
    assert spread(2.0, 0.0, 0.0, 4.0) == 0.0


@pytest.mark.parametrize("filtered", [True, False])
@given(distances=st.lists(st.floats(0.04, 1.0), min_size=7, max_size=7))
def test_what_is_seen_counts_as_nearer_by_its_spread(panda_model, paper_skin, filtered, distances):
    skin, params = (unsure(paper_skin, panda_model, 0.01, 0.05), PARAMS if filtered else BARE)
    watcher = Watcher(panda_model, skin, FLOOR, params)
    near = look(watcher, distances)
    exact = seen(panda_model, paper_skin, distances, params)
    both = np.isin(exact.unit, near.unit)
    assert set(near.unit) <= set(exact.unit)
    assert filtered or both.all()
    u = 2.0 * np.hypot(0.01, 0.05 * np.array(distances)[near.unit])
    for name in ("point", "body_point", "direction", "link"):
        np.testing.assert_array_equal(getattr(near, name), getattr(exact, name)[both])
    np.testing.assert_allclose(near.body_distance, exact.body_distance[both] - u, atol=1e-12)
    ee_distance = np.maximum(exact.ee_distance[both] - u, 0.0)
    np.testing.assert_allclose(near.ee_distance, ee_distance, atol=1e-12)
    assert watcher.now.get("scene.nearest") == near.ee_distance.min(initial=np.inf)


@given(distances=st.lists(st.floats(0.0, 5.0) | st.just(np.nan), min_size=7, max_size=7))
def test_no_bit_changes_where_nothing_is_uncertain(panda_model, paper_skin, distances):
    mixed = Skin([replace(paper_skin.units[0], position_sigma=0.02), *paper_skin.units[1:]], panda_model)
    watchers = [
        Watcher(panda_model, paper_skin),
        Watcher(panda_model, paper_skin, FLOOR, replace(PARAMS, spread_sigmas=9.0)),
        Watcher(panda_model, unsure(paper_skin, panda_model, 0.5, 1.5), FLOOR, replace(PARAMS, spread_sigmas=0.0)),
    ]
    usual, *_ = (look(watcher, distances) for watcher in watchers)
    for other in watchers[1:]:
        assert same(watchers[0].now.blocks, other.now.blocks)
        assert same(watchers[0].memory.blocks, other.memory.blocks)
    near = seen(panda_model, mixed, distances)
    for name in ("unit", "point", "direction", "body_distance", "ee_distance"):
        np.testing.assert_array_equal(getattr(near, name)[near.unit > 0], getattr(usual, name)[usual.unit > 0])


def test_a_kept_point_is_as_uncertain_as_it_is_now_far_from_its_unit(panda_model, paper_skin):
    skin = unsure(paper_skin, panda_model, orientation=0.1)
    watcher, exact = (Watcher(panda_model, of, FLOOR, BARE) for of in (skin, paper_skin))
    first, _ = look(watcher, 0.3), look(exact, 0.3)
    watcher.q = exact.q = panda().q_ready + 0.3 * np.eye(7)[0]
    kept, plain = look(watcher, 0.3, 1.03), look(exact, 0.3, 1.03)
    kin = panda_model.kinematics(watcher.q)
    place = [kin.position[m] + kin.rotation[m] @ T[:3, 3] for m, T in zip(skin.link, skin.T_link_sensor, strict=True)]
    away = np.linalg.norm(kept.point - place, axis=1)
    assert np.ptp(away) > 0.1
    np.testing.assert_array_equal(kept.point, first.point)
    np.testing.assert_allclose(kept.body_distance, plain.body_distance - 2.0 * 0.1 * away, atol=1e-12)


# The arm in view


def first_shown(model, skin: Skin, params=PARAMS) -> float:
    """From which distance on, coming from far, the hand's unit that sees the forearm shows something [m]."""
    unit, watcher = skin.ids.index("hand_back"), Watcher(model, skin, FLOOR, params)
    distances = enumerate(np.arange(0.36, 0.04, -0.0005))  # a second apart, so that nothing is remembered
    return float(next(d for now, d in distances if unit in look(watcher, d, now, now).unit))


def test_an_uncertain_unit_does_not_take_its_own_arm_for_an_obstacle(panda_model, paper_skin):
    exact = first_shown(panda_model, paper_skin)
    unsure_by_15_mm = first_shown(panda_model, unsure(paper_skin, panda_model, position=0.015))
    assert exact == pytest.approx(0.354 - 0.06, abs=2e-3)
    assert unsure_by_15_mm == pytest.approx(exact - 2 * 0.015, abs=1.1e-3)
    # d + 0.06 + 2 * 0.05 d = 0.354
    turned = first_shown(panda_model, unsure(paper_skin, panda_model, orientation=0.05))
    assert turned == pytest.approx((0.354 - 0.06) / 1.1, abs=2e-3)


@pytest.mark.parametrize("sigmas", [(0.5, 0.0), (0.0, np.pi / 2), (0.5, np.pi / 2)])
def test_however_uncertain_the_margin_at_most_doubles(panda_model, paper_skin, sigmas):
    worst = first_shown(panda_model, unsure(paper_skin, panda_model, *sigmas))
    assert worst == pytest.approx(0.354 - 2 * 0.06, abs=2e-3)
    bare = replace(PARAMS, self_margin_m=0.0)
    worst_of_none = first_shown(panda_model, unsure(paper_skin, panda_model, *sigmas), bare)
    assert worst_of_none == first_shown(panda_model, paper_skin, bare)
