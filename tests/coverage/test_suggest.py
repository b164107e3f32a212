"""Blind spots, and places for more units: the best first, as good as greedy choices are bound to be."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.coverage.blind import BLIND, blind_spots
from pretouch.coverage.measure import covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import HEIGHT_M, candidates, greedy, suggest
from pretouch.coverage.ways import seen_by, ways_met, ways_to
from pretouch.robot.body import surface_of
from pretouch.sensing.skin import Skin, load_skin, save_skin
from pretouch.sensing.unit import seat
from pretouch.sim.scene import SceneSpec, fixtures
from tests.coverage.made import ROOM, arm, skin


@pytest.fixture(scope="module")
def made(panda_model):
    q = panda_model.description.q_ready + 0.1 * np.random.default_rng(3).uniform(-1, 1, (3, 7))
    points = np.repeat(np.arange(0, len(panda_model.surface.link), 3), 3)
    return ways_to(panda_model, fixtures(SceneSpec()), CoverageParams(), q, points, np.random.default_rng(4))


def ways_all_over(model, q, each, spacing):
    surface = surface_of(model.body, model.moved_by, model.kinematics(q[0]), spacing)
    points = np.repeat(np.arange(len(surface.link)), each)
    return ways_to(model, ROOM, CoverageParams(), q, points, np.random.default_rng(1), surface)


@given(st.integers(0, 10_000), st.integers(1, 4))
def test_a_greedy_choice_of_one_in_each_group_is_near_the_best(seed, count):
    rng = np.random.default_rng(seed)
    sees, weight, group = rng.uniform(size=(7, 30)) < 0.3, rng.uniform(size=30), rng.integers(0, 5, 7)
    order, gains = zip(*greedy(sees, weight, count, group), strict=True)
    assert len(set(group[list(order)])) == len(order) <= count
    assert all(a >= b - 1e-12 for a, b in pairwise(gains))
    assert sum(gains) == pytest.approx(weight[sees[list(order)].any(axis=0)].sum())
    sets = [list(some) for some in combinations(range(7), len(order)) if len(set(group[list(some)])) == len(order)]
    assert 0.5 * max(weight[sees[some].any(axis=0)].sum() for some in sets) <= sum(gains) + 1e-12


def test_gains_fall_and_add_up_to_what_the_larger_skin_sees_of_what_comes_and_is_met(made, panda_model, paper_skin):
    q = np.array([panda_model.description.q_ready])
    met = ways_met(panda_model, made.room, made.params, q, np.array([[0.0, 1.0, 0.0]]))
    for ways in ((made,), (made, met)):
        found = suggest(ways, paper_skin, 4)
        gains = [one.gain for one in found]
        assert gains == sorted(gains, reverse=True)
        assert gains[-1] > 0
        more = Skin((*paper_skin.units, *(one.unit for one in found)), panda_model)
        seen = np.array([[covered(w, seen_by(w, worn)).arm.ways for w in ways] for worn in (paper_skin, more)])
        assert sum(gains) == pytest.approx((seen[1] - seen[0]).mean(), rel=1e-6)


def test_places_sit_on_the_surface_and_look_off_the_arm_and_at_the_hand_along_it(made, panda_model, paper_skin):
    places, spots = candidates(made, paper_skin), list[tuple[float, ...]]()
    assert len(places) > 50
    for unit in places:
        link, (beam, place) = panda_model.link_index(unit.link), unit.T_link_sensor[:3, 2:].T
        assert 0 < seat(panda_model, link, place).height <= HEIGHT_M + 2e-5  # another capsule may be a little nearer
        if panda_model.moved_by[link].all():
            spots.append(tuple(place))
        else:
            assert seat(panda_model, link, place - HEIGHT_M * beam).height == pytest.approx(0.0, abs=2e-5)
        for other in paper_skin.units:
            apart = np.linalg.norm(other.T_link_sensor[:3, 3] - unit.T_link_sensor[:3, 3])
            assert other.link != unit.link or apart >= 0.03
    assert len(spots) > 2 * len(set(spots)), "most have three or more beams"


def test_the_file_with_new_units_keeps_the_old_ones(made, panda_model, paper_skin, tmp_path):
    found = suggest((made,), paper_skin, 2)
    save_skin(Skin((*paper_skin.units, *(one.unit for one in found)), panda_model), tmp_path / "more.toml")
    read = load_skin(tmp_path / "more.toml", panda_model)
    assert read.ids == (*paper_skin.ids, "suggested_1", "suggested_2")
    np.testing.assert_allclose(read.T_link_sensor[:7], paper_skin.T_link_sensor, atol=1e-12)
    (again,) = suggest((made,), read, 1)
    assert again.unit.id == "suggested_3"
    assert again.gain <= found[1].gain + 1e-12


def test_the_back_of_a_capsule_with_a_unit_in_front(tmp_path):
    model = arm(tmp_path)
    made = ways_all_over(model, np.zeros((2, 2)), 10, 0.01)
    worn = skin(model)
    found = covered(made, seen_by(made, worn))
    spots = blind_spots(made, found)
    areas = [spot.area_m2 for spot in spots]
    assert areas == sorted(areas, reverse=True)
    assert sum(areas) == pytest.approx(made.surface.area[found.point_share < BLIND].sum())
    assert all(spot.share < BLIND for spot in spots)
    back = next(spot for spot in spots if spot.link == "one" and spot.facing == "-x")
    # a quarter of the way round along 0.4 m, and a sixth of the two ends
    assert back.area_m2 == pytest.approx(np.pi / 2 * 0.05 * 0.4 + 4 * np.pi * 0.05**2 / 6, abs=0.0025)
    assert back.side == "back"
    assert back.center == pytest.approx([-0.045, 0.0, 0.2], abs=0.01)
    assert back.share == 0.0
    place = ", ".join(f"{x:.2f}" for x in back.center)
    assert back.sentence == (f"one, its back, facing -x at ({place}) m of the link: {1e4 * back.area_m2:.0f} cm^2")


def test_a_side_that_changes_with_the_posture_has_no_name(tmp_path):
    model = arm(tmp_path)
    q = np.array([[0.0, 0.0], [3.0, 0.0], [-1.5, 0.0], [1.5, 0.0]])
    made = ways_all_over(model, q, 4, 0.015)
    found = covered(made, np.zeros((0, *made.free.shape), np.bool_))
    spots = blind_spots(made, found)
    assert {spot.side for spot in spots if spot.facing in ("-x", "+y")} == {""}
    assert {spot.side for spot in spots if spot.facing == "+z"} == {"upper side"}
    assert sum(spot.area_m2 for spot in spots) == pytest.approx(found.arm.area_m2)
