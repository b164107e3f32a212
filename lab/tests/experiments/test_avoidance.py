import numpy as np
from tests.limits import assert_within_limits

from pretouch_lab.experiments import avoidance

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
