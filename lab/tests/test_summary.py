from lab.tests.width import width

from pretouch_lab.registry import summarise, tables
from pretouch_lab.tables import controller, shown_controllers


def static_row(profile, seed, peak, **changes):
    return {
        "experiment": "static", "trajectory": "circle", "side": "-y", "profile": profile, "restrictions": "off",
        "stiffness_n_per_m": 25e3, "seed": seed, "contact": True, "impact_speed_m_s": 0.2, "detection_delay_s": 0.05,
        "filtered_at_detection_n": 12.0, "raw_at_detection_n": 30.0, "peak_estimate_n": peak, "true_peak_20ms_n": 40.0,
        "true_peak_n": 41.0, "least_sensed_m": 0.05, "false_detections": 0, "held": False,
    } | changes  # fmt: skip


def contact(**changes):
    return {
        "detected": True, "delay_s": 0.06, "direction_error_deg": 4.0, "push_n": 20.0, "push_s": 0.3,
        "reaction_towards_person": False,
    } | changes  # fmt: skip


def dynamic_row(contacts):
    return {
        "experiment": "dynamic", "profile": "paper", "restrictions": "slack", "seed": 0, "contacts": contacts,
        "peak_estimate_n": 30.0, "true_peak_20ms_n": 30.0, "true_peak_n": 50.0, "false_detections": 1, "held": False,
    }  # fmt: skip


def test_ratios_pair_trials_of_the_same_seed():
    rows = [static_row("blind", 0, 80.0), static_row("blind", 1, 90.0), static_row("paper", 0, 20.0)]
    rows += [static_row("paper", 1, 30.0), static_row("paper", 2, 1.0)]
    (ratio,) = summarise(rows)["static"]["ratios"]
    assert ratio["of"] == "blind/paper"
    assert ratio["peak_estimate_n"] == {"median": 3.5, "p10": 3.1, "p90": 3.9, "n": 2}


def test_trials_without_contact_are_counted_but_not_averaged():
    missed = static_row("paper", 1, None, contact=False, detection_delay_s=None)
    (cell,) = summarise([static_row("paper", 0, 20.0), missed])["static"]["cells"]
    assert cell["contact_fraction"] == 0.5
    assert cell["detected_fraction"] == 0.5
    assert cell["peak_estimate_n"]["n"] == 1


def test_pushes_of_all_trials_are_pooled():
    missed = contact(detected=False, delay_s=None, direction_error_deg=None, reaction_towards_person=True)
    summary = summarise([dynamic_row([contact(), missed]), dynamic_row([contact(delay_s=0.08)])])
    assert set(summary) == {"dynamic"}, "only experiments that ran are summarised"
    (cell,) = summary["dynamic"]["cells"]
    assert (cell["detected"], cell["pushes"]) == (2, 3)
    assert cell["delay_s"]["median"] == 0.07
    assert cell["reactions_towards_person"] == 1
    assert cell["false_detections"] == 2


def test_tables_show_medians_and_ratios():
    rows = [static_row("blind", 0, 80.0), static_row("paper", 0, 20.0), dynamic_row([contact()])]
    static, dynamic = tables(summarise(rows))
    assert [row[0] for row in static.rows] == ["blind\ncircle -y", "paper\ncircle -y", "ratio"]
    assert static.rows[0][5] == "80.0\n80-80"
    assert static.rows[0][1] == "0.200\n0.20-0.20"
    assert static.rows[2][5] == "4.00\n4.0-4.0"
    assert static.rows[0][-1] == "1/1"
    assert dynamic.rows[0][:3] == ("paper", "1 of 1", "60")
    for table in (static, dynamic):
        assert all(len(row) == len(table.header) for row in table.rows)


def test_ratios_pair_trials_at_the_same_place_and_stiffness():
    places = [("circle", "-y", 2e3), ("circle", "-y", 25e3), ("line", "-y", 25e3)]
    rows = []
    for i, (trajectory, side, stiffness) in enumerate(places):
        where = {"trajectory": trajectory, "side": side, "stiffness_n_per_m": stiffness}
        rows += [static_row("blind", 0, 20.0 * (i + 2), **where), static_row("paper", 0, 20.0, **where)]
    part = summarise(rows)["static"]
    assert [r["peak_estimate_n"]["median"] for r in part["ratios"]] == [2.0, 3.0, 4.0]
    pooled = {r["stiffness_n_per_m"]: r["peak_estimate_n"] for r in part["pooled_ratios"]}
    assert pooled[2e3]["n"] == 1
    assert pooled[25e3]["median"] == 3.5
    assert [c["trials"] for c in part["pooled_cells"]] == [1, 1, 2, 2]


def test_more_of_a_grid_is_shown_in_more_tables():
    rows = [static_row(name, 0, 20.0) for name in ("blind", "paper", "slowing-only")]
    rows.append(static_row("paper", 0, None, restrictions="hard", contact=False, detection_delay_s=None))
    places, by_use, by_mode = tables(summarise(rows))
    assert [row[0].split("\n")[0] for row in places.rows] == ["blind", "paper", "ratio"]
    names = [row[0].split("\n")[0] for row in by_use.rows]
    assert names == ["blind", "paper", "ratio", "slowing-only", "ratio"]
    assert [row[:2] for row in by_mode.rows] == [
        ("paper\noff", "1/1"), ("slowing-only\noff", "1/1"), ("paper\nhard", "0/1"),
    ]  # fmt: skip
    for table in (places, by_use, by_mode):
        assert width(table) <= 80
        assert all(len(row) == len(table.header) for row in table.rows)


def test_blind_one_other_with_restrictions_off_and_pretouch_are_shown_in_detail_and_several_modes_are_named():
    def cell(profile, restrictions, stiffness=25e3):
        return {"profile": profile, "restrictions": restrictions, "stiffness_n_per_m": stiffness}

    many = [cell("paper", "hard"), cell("paper", "off"), cell("slowing-only", "off"), cell("blind", "off")]
    assert shown_controllers(many) == (
        25e3, {"paper": "off", "slowing-only": "off", "blind": "off"}, ["blind", "paper"],
    )  # fmt: skip
    three = shown_controllers([*many, cell("pretouch", "braking"), cell("other", "off")])
    assert three[2] == ["blind", "paper", "pretouch"]
    assert shown_controllers([cell("blind", "off", 2e3)])[::2] == (2e3, ["blind"])
    cells = [cell("paper", "hard"), cell("paper", "slack"), cell("blind", "off")]
    assert shown_controllers(cells[1::-1])[1:] == ({"paper": "slack"}, ["paper"])
    assert [controller(each, cells) for each in cells] == ["paper\nhard", "paper\nslack", "blind"]


def test_a_table_without_the_default_mode_says_so():
    rows = [static_row("paper", 0, None, restrictions="hard", contact=False, detection_delay_s=None)]
    (table,) = tables(summarise(rows))
    assert "hard restrictions" in table.title
    assert table.rows[0][-1] == "0/0"
