"""The tables of the paper's three experiments, by rows by hand."""

from pretouch_lab.encounters import Encounter, met
from pretouch_lab.experiments import avoidance, dynamic, static
from pretouch_lab.experiments.static import shown_controllers


def static_row(profile, seed, peak, **changes):
    row = {"trajectory": "circle", "side": "-y", "stiffness_n_per_m": 25e3, "profile": profile, "restrictions": "off"}
    row |= {"seed": seed, "contact": True, **dict.fromkeys(static.MEASURES, 40.0), "impact_speed_m_s": 0.2}
    row |= {"detection_delay_s": 0.05, "peak_estimate_n": peak, "least_sensed_m": 0.05, "false_detections": 0}
    return row | changes


def missed(profile, seed, **changes):
    return static_row(profile, seed, None, contact=False, **dict.fromkeys(static.MEASURES), **changes)


def test_the_static_table_shows_medians_and_ratios_to_the_trial_of_the_same_seed():
    rows = [static_row("blind", 0, 80.0), static_row("blind", 1, 90.0), static_row("paper", 0, 20.0)]
    rows += [static_row("paper", 1, 30.0), missed("paper", 2)]
    forces, smaller = static.tables(rows)
    assert [row[0] for row in forces.rows] == ["blind\n25 N/mm", "paper\n25 N/mm"]
    assert forces.rows[0][1:3] == ("0.200\n0.20-0.20", "50\n50-50")
    assert [row[5] for row in forces.rows] == ["85.0\n81-89", "25.0\n21-29"], "what is missing is not averaged"
    assert [row[-1] for row in forces.rows] == ["2/2", "2/2"]
    assert smaller.rows == (("paper\n25 N/mm", *["1.00\n1.00-1.00"] * 3, "3.50\n3.10-3.90", *["1.00\n1.00-1.00"] * 2),)


def test_ratios_are_of_the_same_place_and_stiffness_and_pooled_by_stiffness():
    places = [("circle", "-y", 2e3), ("circle", "-y", 25e3), ("line", "-y", 25e3)]
    rows = []
    for i, (trajectory, side, stiffness) in enumerate(places):
        where = {"trajectory": trajectory, "side": side, "stiffness_n_per_m": stiffness}
        rows += [static_row("blind", 0, 20.0 * (i + 2), **where), static_row("paper", 0, 20.0, **where)]
    forces, smaller = static.tables(rows)
    assert [row[0] for row in forces.rows] == ["blind\n2 N/mm", "paper\n2 N/mm", "blind\n25 N/mm", "paper\n25 N/mm"]
    assert [row[4] for row in smaller.rows] == ["2.00", "3.50\n3.10-3.90"]


def test_modes_are_a_table_of_their_own():
    rows = [static_row(name, 0, 20.0) for name in ("blind", "paper", "slowing-only")]
    rows.append(missed("paper", 0, restrictions="hard"))
    forces, _, by_mode = static.tables(rows)
    assert [row[0].split("\n")[0] for row in forces.rows] == ["blind", "paper", "slowing-only"]
    modes = [("paper\noff", "1/1"), ("slowing-only\noff", "1/1"), ("paper\nhard", "0/1")]
    assert [row[:2] for row in by_mode.rows] == modes
    (table,) = static.tables(rows[3:])
    assert table.rows[0][-1] == "0/0"


def test_blind_one_other_and_pretouch_are_shown_in_detail_with_their_first_modes():
    def cell(profile, restrictions, stiffness=25e3):
        return {"profile": profile, "restrictions": restrictions, "stiffness_n_per_m": stiffness}

    many = [cell("paper", "off"), cell("paper", "hard"), cell("slowing-only", "off"), cell("blind", "off")]
    modes = {"paper": "off", "slowing-only": "off", "blind": "off"}
    assert shown_controllers(many) == (25e3, modes, ["blind", "paper"])
    three = shown_controllers([*many, cell("pretouch", "braking"), cell("other", "off")])
    assert three[2] == ["blind", "paper", "pretouch"]
    assert shown_controllers([cell("blind", "off", 2e3)])[::2] == (2e3, ["blind"])
    assert shown_controllers(many[1:2])[1:] == ({"paper": "hard"}, ["paper"])
    chosen = static.shown_cells([static_row("blind", 0, 1.0), static_row("paper", 0, 1.0, restrictions="hard")])
    assert [row["profile"] for row in chosen] == ["blind", "paper"]


def test_pushes_of_all_trials_are_pooled():
    push = {"detected": True, "delay_s": 0.06, "direction_error_deg": 4.0, "reaction_towards_person": False}
    unfelt = dict.fromkeys(("delay_s", "direction_error_deg")) | {"detected": False, "reaction_towards_person": True}
    trial = {"profile": "paper", "restrictions": "slack", "peak_estimate_n": 30.0, "false_detections": 1}
    rows = [trial | {"contacts": [push, unfelt]}, trial | {"contacts": [push | {"delay_s": 0.08}]}]
    (table,) = dynamic.tables(rows)
    assert table.rows == (("paper\nslack", "2/3", "70", "4.0", "30.0", "1", "2"),)


def hand_row(place, profile, seed, travelled, *touches, empty_s=0.0):
    row = {"place": place, "profile": profile, "restrictions": "slack", "arm": "panda", "skin": "7 vl53l1x"}
    row |= {"contact": bool(touches), "true_peak_n": 0.0, "least_gap_m": 0.03, "deviation_m": 0.02, **met([*touches])}
    row |= {"least_speed_scale": 0.5, "travelled_m": travelled, "false_detections": 0, "seed": seed}
    return row | {"ghost_share": 0.004, "ghost_s": 2.0, "empty_s": empty_s}


def test_the_tables_of_hands_are_by_place_and_profile_and_a_way_is_compared_with_that_of_blind():
    touches = (0.05, 0.0, 9.0, 0.0), (0.2, 0.0, 30.0, 0.0), (0.0, 0.5, 70.0, 0.0)
    soft, hard, by_hand = (Encounter(1, 8, *each) for each in touches)
    rows = [hand_row("beside", "blind", 0, 10.0), hand_row("beside", "paper", 0, 9.0, empty_s=1.5)]
    rows += [hand_row("inside", "paper", seed, 5.0, *each) for seed, each in enumerate(([], [soft], [hard], [by_hand]))]
    effects, hands, ghosts = avoidance.tables(rows)
    assert effects.rows[1][2:] == ("panda\n7 vl53l1x", "0/1", "0.0", "0.030", "0.020", "0.50", "9.00", "90.0", "0")
    # the share p of at least 3 of 4, 4 p^3 (1 - p) + p^4, is 5 % at 0.249
    assert hands.rows[0][3:] == ("2/4", "3/4", "25", "0.125\n0.07-0.18", "19.5\n11-28", "1")
    assert hands.rows[1][0::2] == ("all", "all\n7 vl53l1x", "3/4", "0.125\n0.07-0.18", "1")
    assert [row[-2:] for row in ghosts.rows] == [("0.00", "0/1"), ("1.50", "1/1"), ("0.00\n0.00-0.00", "0/4")]
    assert ghosts.rows[0][3] == "4.00"
