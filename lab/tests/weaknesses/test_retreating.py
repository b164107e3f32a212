import numpy as np
import pytest
from lab.tests.rows import made_up
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch_lab.cell import Cell, Grid
from pretouch_lab.weaknesses import retreating

MODES = {"blind": "off", "paper": "off"}


@pytest.fixture(scope="module")
def trials(context):
    cell = {name: Cell(retreating.NAME, name, {"restrictions": mode}) for name, mode in MODES.items()}
    return {name: retreating.trial(cell[name], 150, context) for name in cell}


def test_the_arm_is_as_slow_on_its_way_back_from_the_board_as_towards_it(trials):
    blind, paper = (trials[name][0] for name in ("blind", "paper"))
    assert paper["retreat_m_s"] < 0.7 * blind["retreat_m_s"]
    assert paper["retreat_m_s"] == pytest.approx(paper["approach_m_s"], rel=0.15)
    assert paper["way_back_s"] > blind["way_back_s"] + 0.5
    assert blind["approach_m_s"] > 0.27


def test_the_board_is_out_of_the_way(trials, panda_model):
    for row, record in trials.values():
        assert row["contact"] is False
        assert row["false_detections"] == 0
        assert_within_limits(record, panda_model)
    assert 0.05 < trials["paper"][0]["least_sensed_m"] < 0.15


def test_the_board_stands_beyond_the_end_as_far_as_said():
    for seed in range(100, 120):
        (board,) = retreating.scene(seed).boxes
        clear = -0.5 - 0.102 - (board.center[1] + board.half_size[1])
        assert 0.05 <= clear <= 0.10


def test_the_numbers_of_a_made_up_trial():
    times = np.arange(0.0, 12.01, 0.1)
    # 0.25 m/s to the end at 4 s, 0.125 m/s for the 0.3 m after it, 0.25 m/s from there
    phase = [0.25 * t if t <= 4 else 1 + 0.125 * (t - 4) if t <= 6.4 else 1.3 + 0.25 * (t - 6.4) for t in times]
    row = retreating.results(made_up(times, path_phase=phase))
    assert row["approach_m_s"] == pytest.approx(0.25, rel=0.05)
    assert row["retreat_m_s"] == pytest.approx(0.125, rel=0.05)
    assert row["way_back_s"] == pytest.approx(2.4 + 2.8, abs=0.15)
    assert row["cycle_s"] == pytest.approx(2.0 + 2.4 + 4.8, abs=0.15)
    assert row["short_of_end_m"] == 0.0
    short = retreating.results(made_up(times[:31], path_phase=phase[:31]))
    assert short["short_of_end_m"] == pytest.approx(0.25)
    assert (short["approach_m_s"], short["cycle_s"]) == (None, None)


def test_what_is_lost_is_against_blind_with_the_same_seed(trials):
    blind, paper = (trials[name][0] for name in ("blind", "paper"))
    rows = [
        blind | {"seed": 1, "way_back_s": 4.0},
        paper | {"seed": 1, "way_back_s": 6.0, "cycle_s": 10.0},
        paper | {"seed": 2, "way_back_s": 9.0, "cycle_s": 10.0},
    ]
    part = retreating.summarise(rows)
    by_profile = {cell["profile"]: cell for cell in part["cells"]}
    assert by_profile["paper"]["lost_s"] == {"median": 2.0, "p10": 2.0, "p90": 2.0, "n": 1}
    assert by_profile["paper"]["lost_fraction"]["median"] == 0.2
    assert by_profile["blind"]["lost_s"] is None
    assert retreating.summarise(rows[1:])["cells"][0]["lost_s"] is None
    (table,) = retreating.tables(part)
    assert width(table) <= 80


def test_cells_hold_the_slow_down_alone():
    found = [(c.profile, c.where["restrictions"]) for c in retreating.cells(Grid(("blind", "paper")))]
    assert found == [
        ("blind", "off"), ("paper", "off"), ("paper", "slack"), ("slowing-only", "off"), ("slowing-only", "slack"),
    ]  # fmt: skip


@pytest.mark.slow
def test_with_restrictions_the_arm_never_gets_to_the_end(context):
    row, _ = retreating.trial(Cell(retreating.NAME, "paper", {"restrictions": "slack"}), 151, context)
    assert row["short_of_end_m"] > 0.05
    assert row["retreat_m_s"] is None
