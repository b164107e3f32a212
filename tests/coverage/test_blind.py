"""Blind spots and their names."""

import numpy as np
import pytest

from pretouch.coverage.blind import BLIND, blind_spots
from pretouch.coverage.measure import covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.surface import surface_of
from pretouch.coverage.ways import seen_by, ways_to
from pretouch.sim.scene import SceneSpec, fixtures
from tests.coverage.made import ROOM, arm, skin


def test_the_back_of_a_capsule_with_a_unit_in_front(tmp_path):
    model = arm(tmp_path)
    made = ways_to(
        model, ROOM, CoverageParams(), surface_of(model, 1500), np.zeros((2, 2)), 10, np.random.default_rng(1)
    )
    worn = skin(model)
    found = covered(made, seen_by(made, worn))
    spots = blind_spots(made, found)
    back = next(spot for spot in spots if spot.link == "one" and spot.facing == "-x")
    # a quarter of the way round along 0.4 m, and what of the two ends faces that way
    assert back.area_m2 == pytest.approx(np.pi / 2 * 0.05 * 0.4 + 0.003, abs=0.0025)
    assert back.side == "back"
    assert back.center == pytest.approx([-0.045, 0.0, 0.2], abs=0.01)
    assert back.share == 0.0
    place = ", ".join(f"{x:.2f}" for x in back.center)
    assert back.sentence == (f"one, its back, facing -x at ({place}) m of the link: {1e4 * back.area_m2:.0f} cm^2")


def test_a_side_that_changes_with_the_posture_has_no_name(tmp_path):
    model = arm(tmp_path)
    q = np.array([[0.0, 0.0], [3.0, 0.0], [-1.5, 0.0], [1.5, 0.0]])
    made = ways_to(model, ROOM, CoverageParams(), surface_of(model, 600), q, 4, np.random.default_rng(1))
    found = covered(made, np.zeros((0, *made.free.shape), np.bool_))
    spots = blind_spots(made, found)
    assert {spot.side for spot in spots if spot.facing in ("-x", "+y")} == {""}
    assert {spot.side for spot in spots if spot.facing == "+z"} == {"upper side"}
    assert sum(spot.area_m2 for spot in spots) == pytest.approx(found.arm.area_m2)


def test_spots_of_the_panda_are_blind_and_the_largest_come_first(panda_model, paper_skin):
    q = np.tile(panda_model.description.q_ready, (3, 1))
    made = ways_to(
        panda_model, fixtures(SceneSpec()), CoverageParams(), surface_of(panda_model, 800), q, 4,
        np.random.default_rng(2),
    )  # fmt: skip
    found = covered(made, seen_by(made, paper_skin))
    spots = blind_spots(made, found)
    areas = [spot.area_m2 for spot in spots]
    assert areas == sorted(areas, reverse=True)
    assert all(spot.share < BLIND for spot in spots)
    assert sum(areas) == pytest.approx(made.surface.area[found.point_share < BLIND].sum())
