from pretouch_lab.bench.avoidance import plays, summarise, tables


def row(baseline, seed, scenario="drdo", family="drdo", **measures):
    """A trial without a contact."""
    numbers = dict.fromkeys(
        (
            "true_peak_20ms_n", "true_peak_n", "clamping_force_n", "tracking_rms_m", "off_path_max_m",
            "jerk_max_rad_s3", "jerk_max_per_second_rad_s3", "jerk_rms_rad_s3", "held_s",
        ),
        0.0,
    )  # fmt: skip
    counts = dict.fromkeys(
        ("holds", "livelocks", "reactions", "false_reactions", "towards_person", "solver_failures", "infeasible"), 0
    )
    absent = dict.fromkeys(("peak_estimate_n", "impact_speed_m_s", "first_contact_s", "seen_fraction", "cycle_time_s"))
    usual = {
        "contact": False, "least_distance_m": 0.1, "speed_m_s": 0.3, "way_m": 3.0, "livelock_s": 0.0, "timed": False,
        "hold_events": {}, "duration_s": 14.0,
    }  # fmt: skip
    names = {"contender": baseline, "scenario": scenario, "family": family, "seed": seed}
    return {**names, **numbers, **counts, **absent, **usual, **measures}


def test_a_turn_that_was_not_finished_counts_as_longer_than_all():
    rows = [row("paper", s, "person +y", "person", timed=True, cycle_time_s=t) for s, t in enumerate([5.0, None, 7.0])]
    cell = summarise(rows)["cells"][0]
    assert cell["cycle_time_s"] == {"median": 7.0, "p10": 5.0, "p90": None, "n": 3}
    assert "7.0\n5.0->" in tables(summarise(rows))[0].rows[0]


def test_reasons_of_holds_are_added_up():
    rows = [row("ding", s, hold_events={"latched": 2}, holds=2) for s in (0, 1)]
    cell = summarise(rows)["cells"][0]
    assert (cell["holds"], cell["hold_events"]) == (4, {"latched": 4})


def test_tables_say_who_touched():
    rows = [
        row(c, s, contact=c == "ding", true_peak_20ms_n=70.0 * (c == "ding")) for c in ("paper", "ding") for s in (0, 1)
    ]
    shown = tables(summarise(rows))[0]
    assert [line[:3] for line in shown.rows] == [("drdo", "paper", "0/2"), ("drdo", "ding", "2/2")]


def test_no_trial_is_played_twice_and_a_quick_run_is_a_small_part():
    every = [(str(cell), seed) for cell, seed in plays("development", quick=False)]
    assert len(set(every)) == len(every)
    assert {(str(cell), seed) for cell, seed in plays("development", quick=True)} < set(every)
    assert len(plays("development", quick=True)) < len(every) / 5
    assert {cell["contender"] for cell, _ in plays("development", True, ["paper"], ["drdo"])} == {"paper"}
