import numpy as np
import pytest
from tests.limits import assert_within_limits

from pretouch.errors import ExperimentError
from pretouch_lab.experiments import avoidance
from pretouch_lab.options import TrialOptions

MODES = {"blind": "off", "paper": "slack"}
FIRST_OVER_S = 19.0
"""Five seconds after the hand has gone for the first time [s]."""


def test_the_arm_slows_for_the_hand_gives_way_and_recovers_and_blind_passes_by(context, panda_model, monkeypatch):
    monkeypatch.setattr(avoidance, "_DURATION_S", FIRST_OVER_S)
    cell = {name: {"place": "beside", "profile": name, "restrictions": mode} for name, mode in MODES.items()}
    trials = {name: avoidance.trial(cell[name], 400, context) for name in cell}
    (row, record), (blind, _) = trials["paper"], trials["blind"]
    assert row["least_speed_scale"] < 0.6
    assert row["contact"] is False
    assert row["least_gap_m"] > blind["least_gap_m"]
    assert row["deviation_m"] > 5 * blind["deviation_m"]
    last = record.steps[-1]
    assert last.speed_scale == 1.0
    assert np.linalg.norm(last.ee_position - last.path_position) < 0.02
    assert blind["least_speed_scale"] == 1.0
    assert blind["deviation_m"] < 0.01
    for _, record in trials.values():
        assert_within_limits(record, panda_model)


def test_a_hand_comes_once_on_each_side_beside_the_path_or_into_it():
    for place, clear in (("beside", 0.0), ("inside", -0.08)):
        first, second = avoidance.visits(place, 0)
        assert first.place[1] < 0 < second.place[1]
        assert first.leave < second.arrive
        for visit in (first, second):
            assert abs(visit.place[1]) - 0.05 - 0.352 > clear - 0.03
    gaps = [abs(v.place[1]) for seed in range(20) for v in avoidance.visits("beside", seed)]
    assert min(gaps) > 0.352 + 0.05 - 0.003


def test_at_the_line_a_hand_is_held_on_it_or_before_it_and_comes_from_the_front():
    for place, before in (("inside line", 0.0), ("beside line", 0.105)):
        every = [visit for seed in range(20) for visit in avoidance.visits(place, seed)]
        assert all(visit.ahead for visit in every)
        away = np.array([visit.place for visit in every]) - [0.4 + before, 0.0, 0.55]
        away[:, 1] = np.abs(away[:, 1]) - 0.25
        assert np.abs(away).max() < 0.03


def test_a_walker_stays_beside_the_path_and_comes_back_without_running():
    for seed in range(20):
        way = avoidance.walk(seed, avoidance.UNMOVED)
        near = np.abs(way.places[:, 1]) <= 0.7
        assert near.tolist() == [True, True, False, False, *[True] * 4, False, False, True, True, False]
        # a ball of 0.15 m beside a circle of 0.25 m
        assert np.abs(way.places[:, 1]).min() - 0.15 - 0.25 >= 0.15 - 1e-9
        speed = np.linalg.norm(np.diff(way.places, axis=0), axis=1) / np.diff(way.times)
        assert speed.max() < 1.3
    assert way.goal(way.times[0] - 1.0, np.zeros(3), None).position.tolist() == way.places[0].tolist()


def test_nobody_slows_nobody_and_an_unknown_place_is_refused(context, monkeypatch):
    monkeypatch.setattr(avoidance, "_DURATION_S", 3.0)
    row, record = avoidance.trial({"place": "nobody line", "profile": "blind", "restrictions": "off"}, 400, context)
    assert (row["ghost_share"], row["least_gap_m"], row["untouched"], row["skin"]) == (0.0, None, True, "none")
    assert row["travelled_m"] > 0.4
    assert record.steps[0].ee_position[1] == pytest.approx(0.5, abs=0.01)
    with pytest.raises(ExperimentError, match="no place 'above' for this arm: choose from beside, inside, beside line"):
        avoidance.cells(TrialOptions(places=("above",)))
    with pytest.raises(ExperimentError, match="no place 'beside line' for this arm"):
        avoidance.cells(TrialOptions(places=("beside line",), arm="fr3"))
