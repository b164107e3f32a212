import json

import numpy as np
import pytest
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.perception.closest import closest_points
from pretouch_lab.cell import Grid
from pretouch_lab.paper.claims import anticipation
from pretouch_lab.paper.claims.anticipation_views import equation_11, expected
from pretouch_lab.paper.claims.approach import DIRECTIONS, approach, outwards
from pretouch_lab.paper.figures.bands import band_figure

CELLS = {str(cell.where["from"]): cell for cell in anticipation.cells(Grid(()))}


@pytest.fixture(scope="module")
def trials(context):
    return {name: anticipation.trial(CELLS[name], 100, context) for name in ("minus-y", "plus-y", "minus-z")}


@pytest.mark.parametrize(("name", "bound", "sign"), [("minus-y", "upper", -1.0), ("plus-y", "lower", 1.0)])
def test_a_hand_from_one_side_lowers_its_bound_by_equation_11(trials, name, bound, sign):
    row, record = trials[name]
    assert row["seen"]
    assert row["nearest"]["true_m"] == pytest.approx(0.2, abs=0.03)
    lowered = row["nearest"][f"{bound}_lowered_n"][1]
    # (0.8 - d) / 0.75 times 4 N at the distance that was sensed
    assert lowered == pytest.approx((0.8 - row["nearest"]["sensed_m"]) / 0.75 * 4.0, abs=2e-3)
    assert row["nearest"][f"{'lower' if bound == 'upper' else 'upper'}_lowered_n"][1] == 0.0
    assert np.sign(record.hand_position[-1][1]) == sign
    widths = [place[f"{bound}_n"][1] for place in row["at"] if place is not None]
    assert widths[0] - widths[-1] > 2.5


def test_a_hand_from_one_side_leaks_into_one_bound_of_each_other_axis(trials):
    for name in ("minus-y", "plus-y"):
        nearest = trials[name][0]["nearest"]
        for axis in (0, 2):
            assert min(nearest["upper_lowered_n"][axis], nearest["lower_lowered_n"][axis]) == 0.0
            assert max(nearest["upper_lowered_n"][axis], nearest["lower_lowered_n"][axis]) > 3.0


def test_a_hand_from_below_is_not_seen_and_moves_no_bound(trials):
    row, _ = trials["minus-z"]
    assert not row["seen"]
    assert row["seen_from_m"] is None
    assert row["nearest"]["true_m"] < 0.11
    assert row["nearest"]["upper_lowered_n"] == row["nearest"]["lower_lowered_n"] == [0.0, 0.0, 0.0]
    assert row["at"][0] is None  # the floor leaves less than 0.8 m


def test_places_are_where_the_hand_truly_was(trials):
    row, record = trials["minus-y"]
    for place, distance in zip(row["at"], anticipation.DISTANCES_M, strict=True):
        if place is None:
            continue
        assert distance - 0.005 < place["true_m"] <= distance
        i = next(
            i for i, s in enumerate(record.steps)
            if s.armed and np.linalg.norm(s.ee_position - record.hand_position[i]) <= distance
        )  # fmt: skip
        limits = record.steps[i].thresholds
        assert place["upper_n"] == pytest.approx(limits.upper - limits.mean, abs=6e-4)


def test_nothing_touches_and_the_arm_stands_still(trials, panda_model):
    for row, record in trials.values():
        assert row["contact"] is False
        assert row["false_detections"] == 0
        assert_within_limits(record, panda_model)
        places = np.array([s.ee_position for s in record.steps])
        assert np.ptp(places, axis=0).max() < 0.003


@pytest.mark.parametrize("name", DIRECTIONS)
@pytest.mark.parametrize("seed", [100, 101])
def test_the_way_in_is_straight_clear_and_ends_three_centimetres_off(panda_model, name, seed):
    from pretouch.control.posture import brought_to

    way = approach(panda_model, name, seed)
    assert np.cross(way.start - way.end, outwards(name)) == pytest.approx(np.zeros(3), abs=1e-12)
    kin = panda_model.kinematics(brought_to(panda_model, np.array([0.4, 0.0, 0.5])))
    ee = kin.position[panda_model.ee]
    for part in np.linspace(0.0, 1.0, 30):
        place = way.start + part * (way.end - way.start)
        found = closest_points(kin, panda_model.body, ee, np.zeros(1, np.int64), place[None], outwards(name)[None])
        gap = float(found.body_distance[0]) - 0.05
        assert gap > 0.025
        assert place[2] > -0.2 + 0.05 + 0.025
    assert gap < 0.04
    long = np.linalg.norm(way.start - way.end)
    assert way.arrival == pytest.approx(3.0 + long / 0.1)


def test_the_expected_bound_is_on_the_side_of_the_hand():
    assert expected("plus-x") == ("lower", 0)
    assert expected("minus-z") == ("upper", 2)
    assert outwards("minus-z").tolist() == [0.0, 0.0, -1.0]


def test_equation_11_counts_to_the_nearest_point_of_the_fist():
    assert equation_11(0.425 + 0.05) == pytest.approx(2.0)
    assert equation_11(0.9) == 0.0
    assert equation_11(0.06) == 4.0


def test_summary_tables_and_figure_of_what_there_is(trials):
    rows = [json.loads(json.dumps(row, allow_nan=False)) for row, _ in trials.values()]
    part = anticipation.summarise(rows)
    assert [cell["from"] for cell in part["cells"]] == ["plus-y", "minus-y", "minus-z"]
    plus, minus, below = part["cells"]
    assert minus["expected"] == "upper_y"
    assert minus["lowered_n"]["upper_y"]["median"] == trials["minus-y"][0]["nearest"]["upper_lowered_n"][1]
    assert (minus["trials_lowered"]["upper_y"], minus["trials_lowered"]["lower_y"]) == (1, 0)
    assert set(below["trials_lowered"].values()) == {0}
    for table in anticipation.tables(part):
        assert width(table) <= 80
    distances, leaks = anticipation.tables(part)
    assert distances.rows[3][:3] == ("-z", "0/1", "-")
    assert leaks.rows[0][6].startswith(f"{plus['lowered_n']['lower_y']['median']:.1f}*")
    panels = {axes.get_title(): axes for axes in band_figure(part["cells"]).axes}
    assert "no unit sees the hand" in [text.get_text() for text in panels["from -z"].texts]
    assert not panels["from -y"].texts
    assert not panels["from +x"].lines
    assert panels["from -y"].lines[-1].get_xdata() == [trials["minus-y"][0]["seen_from_m"]] * 2
    drawn = {line.get_label(): line for line in panels["from -y"].lines}
    assert drawn["T_u - mu, y"].get_ydata()[-1] == pytest.approx(trials["minus-y"][0]["at"][4]["upper_n"][1], abs=1e-3)


def test_each_direction_has_files_of_its_own():
    assert len({cell.name for cell in CELLS.values()}) == 6
    assert anticipation.summarise([]) == {"cells": []}
    assert anticipation.tables({"cells": []})[0].rows[0][0] == "eq. 11"
