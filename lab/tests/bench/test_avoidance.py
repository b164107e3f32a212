import pytest

from pretouch.errors import ExperimentError
from pretouch_lab.bench.avoidance import losses, plays, summarise, tables


def row(baseline, seed, scenario="drdo", family="drdo", **measures):
    """A trial without a contact."""
    numbers = dict.fromkeys(
        ("true_peak_20ms_n", "clamping_force_n", "tracking_rms_m", "jerk_rms_rad_s3", "held_s"), 0.0
    )
    counts = dict.fromkeys(("holds", "livelocks", "reactions", "false_reactions", "towards_person"), 0)
    absent = dict.fromkeys(("peak_estimate_n", "impact_speed_m_s", "first_contact_s", "cycle_time_s"))
    usual = {"contact": False, "least_distance_m": 0.1, "speed_m_s": 0.3, "livelock_s": 0.0, "timed": False}
    names = {"contender": baseline, "scenario": scenario, "family": family, "seed": seed}
    return {**names, **numbers, **counts, **absent, **usual, **measures}


def test_a_turn_that_was_not_finished_counts_as_longer_than_all_and_tables_say_who_touched():
    rows = [row("paper", s, timed=True, contact=s > 0, cycle_time_s=t) for s, t in enumerate([5.0, None, 7.0])]
    summary = summarise(rows)
    assert summary["cells"][0]["cycle_time_s"] == {"median": 7.0, "p10": 5.0, "p90": None, "n": 3}
    shown = tables(summary)[0].rows[0]
    assert shown[:3] == ("drdo", "paper", "2/3")
    assert "7.0\n5.0->" in shown


def test_an_ablation_is_beside_pretouch_on_the_same_seeds_and_in_no_other_table():
    rows = [row("pretouch", s, holds=s) for s in range(4)] + [row("without react", s) for s in (2, 3)]
    summary = summarise(rows)
    assert [(cell["contender"], cell["trials"], cell["holds"]) for cell in summary["cells"]] == [("pretouch", 4, 6)]
    assert [(c["contender"], c["holds"]) for c in summary["ablations"]] == [("pretouch", 5), ("without react", 0)]


def test_no_trial_is_played_twice_and_a_quick_run_is_a_small_part():
    every = [(str(cell), seed) for cell, seed in plays("development", quick=False)]
    assert len(set(every)) == len(every) == 1228
    assert {(str(cell), seed) for cell, seed in plays("development", quick=True)} < set(every)
    assert len(plays("development", quick=True)) < len(every) / 5
    assert {cell["contender"] for cell, _ in plays("development", True, ["paper"], ["drdo"])} == {"paper"}


def test_what_cannot_be_played_is_refused():
    with pytest.raises(ExperimentError, match="name each once"):
        plays("published", True, ["paper", "paper"])
    with pytest.raises(ExperimentError, match="The scenario 'moon' is unknown: choose from srdo"):
        plays("published", True, names=["drdo", "moon"])


def test_every_cell_another_baseline_wins_is_shown():
    def cell(baseline, **medians):
        names = ("true_peak_20ms_n", "clamping_force_n", "cycle_time_s", "tracking_rms_m", "jerk_rms_rad_s3", "held_s",
                 "livelock_s", "least_distance_m", "speed_m_s")  # fmt: skip
        usual = dict.fromkeys(names, 1.0) | medians
        return {"scenario": "drdo", "contender": baseline, **{k: {"median": v, "n": 1} for k, v in usual.items()}}

    table = losses([
        cell("pretouch", cycle_time_s=None), cell("ding", least_distance_m=1.2, true_peak_20ms_n=0.96),
        cell("flacco", least_distance_m=1.5, held_s=2.0),
    ])  # fmt: skip
    assert table.rows == (
        ("drdo", "turn [s]", ">", "ding 1.0, flacco 1.0"),
        ("drdo", "least distance [mm]", "1000", "flacco 1500, ding 1200"),
    )
