from pretouch_lab.bench.avoidance import losses, paired
from pretouch_lab.bench.goals import front_table, goal_table, goals

MEASURES = ("peak_estimate_n", "true_peak_20ms_n", "clamping_force_n", "first_contact_s", "cycle_time_s")


def trial(baseline, seed, family="static", **measures):
    names = {"family": family, "scenario": family, "contender": baseline, "seed": seed, "timed": family == "person"}
    return {**names, "contact": False, **dict.fromkeys(MEASURES), **measures}


def part_of(rows, measure, reference="blind", baseline="pretouch"):
    (found,) = [
        p for p in paired(rows)
        if (p["measure"], p["reference"], p["contender"]) == (measure, reference, baseline)
    ]  # fmt: skip
    return found["part"], found["trials"]


def test_a_force_is_held_against_the_references_in_the_same_trial_if_that_touched_and_is_none_without_contact():
    rows = [trial("blind", s, contact=True, true_peak_20ms_n=100.0) for s in range(3)]
    rows += [trial("pretouch", 0, contact=True, true_peak_20ms_n=10.0), trial("pretouch", 1, true_peak_20ms_n=0.0)]
    rows += [trial("pretouch", 2, contact=True, true_peak_20ms_n=50.0)]
    assert part_of(rows, "true_peak_20ms_n") == (0.1, 3)
    rows = [trial("blind", 0, true_peak_20ms_n=0.0), trial("pretouch", 0, contact=True, true_peak_20ms_n=10.0)]
    assert paired(rows) == []


def test_never_touching_is_later_than_all_and_never_ending_longer_than_all():
    rows = [trial("paper-off", s, contact=True, first_contact_s=2.0) for s in range(3)]
    rows += [trial("pretouch", s, contact=s == 0, first_contact_s=1.0 if s == 0 else None) for s in range(3)]
    assert part_of(rows, "first_contact_s", "paper-off") == (None, 3)
    turns = [trial("paper", 0, "person"), trial("pretouch", 0, "person", cycle_time_s=9.0)]
    assert part_of(turns, "cycle_time_s", "paper") == (0.0, 1)


def measured(**changes):
    """What both JSON files hold of a `pretouch` that reaches every goal."""
    told = {"quick": True, "seeds": "development"}
    felt = {"median_delay_s": 0.03, "contacts": 90, "missed": 0, "p95_delay_s": 0.05, "towards": 0}
    felt["median_bounds_s"] = [0.01, 0.03]
    rows = [
        {"contender": "pretouch", "scenario": f"free: {name}", "false_alarms_per_hour": 0.4, "hours": 5.0,
         "low_per_hour": 0.05, "high_per_hour": 1.4, "false_alarms": 2}
        for name in ("goal", "goal, nobody near", "goal, somebody standing", "goal, somebody passing")
    ]  # fmt: skip
    rows += [
        {"contender": "pretouch", "scenario": f"contacts: {name}", "seen": seen, **felt}
        for name in ("goal", "all") for seen in (True, False)
    ]  # fmt: skip
    spread = {"median": 5.0, "p10": 4.0, "p90": 6.0}
    families = [
        {"family": family, "contender": name, **dict.fromkeys(MEASURES, spread)}
        for family in ("static", "person") for name in ("blind", "paper", "paper-off", "pretouch")
    ]  # fmt: skip
    pairs = [
        {"family": family, "contender": "pretouch", "reference": reference, "measure": measure, "trials": 32,
         "part": part, "low": 0.5 * part, "high": 1.1 * part}
        for family, reference, measure, part in (
            ("static", "blind", "peak_estimate_n", 0.2), ("static", "blind", "true_peak_20ms_n", 0.25),
            ("static", "paper-off", "first_contact_s", 0.5), ("person", "paper-off", "cycle_time_s", 0.7),
            ("person", "paper", "cycle_time_s", 0.7),
        )
    ]  # fmt: skip
    for pair in pairs:
        pair.update(changes if (pair["reference"], pair["measure"]) == changes.get("of") else {})
    played = [{"contender": "pretouch", "towards_person": changes.get("towards_person", 0), "reactions": 60}]
    detection = {"about": {"bench": "detection", **told}, "rows": rows}
    return detection, {"about": {"bench": "avoidance", **told}, "rows": played, "paired": pairs, "families": families}


def test_goals_that_are_just_reached_are_reached_and_a_missed_one_says_so_with_its_number():
    assert [reached for _, reached, *_ in goals(*measured())] == [True] * 14
    table = goal_table(*measured())
    assert table.rows[0][1:] == ("reached", "0.4/h (2 in 5 h)", "0.05 to 1.4/h")
    assert table.rows[9][2:] == ("5 times (32 trials)", "4.55 to 10 times")
    assert table.rows[12][2:] == ("30 % (32 trials); 6.0 N and 6.0 N", "23 to 65 %")
    late = goal_table(*measured(of=("paper-off", "first_contact_s"), part=None))
    assert late.rows[11][1:] == ("not reached", "0 times (32 trials)", "1.82 to 4 times")
    assert goal_table(*measured(towards_person=1)).rows[8][1] == "not reached"
    detection, avoidance = measured()
    detection["rows"][4]["missed"] = 1
    table = goal_table(detection, avoidance)
    assert table.rows[5][1:] == ("not reached", "1 of 90", "at most 6.0 %")


def test_the_table_of_the_first_page_has_who_it_is_about():
    table = front_table(*measured())
    assert [row[0] for row in table.rows] == ["blind", "paper", "pretouch"]
    assert table.rows[2][1:] == ("5.0 N", "30 ms / 30 ms", "0 of 180", "0 of 180", "5.0 s", "0.4", "0.4")
    assert "all links" in table.note
    detection, avoidance = measured()
    for cell in avoidance["families"]:
        if cell["contender"] == "paper":
            cell["first_contact_s"] = None
    assert front_table(detection, avoidance).rows[1][1] == "keeps away"


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
