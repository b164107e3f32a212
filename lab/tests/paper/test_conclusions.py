from lab.tests.test_summary import contact, dynamic_row, static_row

from pretouch_lab.registry import conclusions, summarise


def avoidance_row(profile, place, **changes):
    return {
        "experiment": "avoidance", "profile": profile, "restrictions": "off", "place": place, "seed": 0,
        "contact": False, "true_peak_n": 0.0, "least_gap_m": 0.0254, "deviation_m": 0.0, "least_speed_scale": 1.0,
        "largest_slack_m_s": 0.0, "travelled_m": 1.0, "false_detections": 0, "held": False,
    } | changes  # fmt: skip


def test_the_static_experiment_in_words():
    rows = [static_row("blind", seed, 80.0, true_peak_20ms_n=100.0 + 2 * seed) for seed in range(2)]
    none = dict.fromkeys(("impact_speed_m_s", "true_peak_20ms_n"))
    rows += [static_row("paper", 0, 20.0), static_row("paper", 1, None, contact=False, **none)]
    rows += [static_row("pretouch", seed, None, contact=False, **none) for seed in range(2)]
    assert conclusions(summarise(rows)) == [
        "The arm runs into a board of 25 N/mm (medians; force: the true one, over 20 ms). blind: 101 N at 0.20 m/s;"
        " paper: 40 N at 0.20 m/s, in 1 of 2 trials; pretouch: no contact."
    ]


def test_a_hand_in_words():
    hit = {"contact": True, "true_peak_n": 92.4}
    rows = [avoidance_row("blind", "inside", **hit), avoidance_row("blind", "beside")]
    rows += [avoidance_row("paper", "beside", least_speed_scale=0.2)]
    assert conclusions(summarise(rows)) == [
        "A person holds a hand 3 cm beside the arm's way. blind: at full speed, 25 mm away; paper: slows to 20 %,"
        " 25 mm away. A person holds a hand into the arm's way. blind: hits it with 92 N."
    ]


def test_pushes_in_words():
    missed = contact(detected=False, delay_s=None, direction_error_deg=None)
    rows = [dynamic_row([contact(), missed]), dynamic_row([missed]) | {"profile": "pretouch"}]
    assert conclusions(summarise(rows)) == [
        "A person pushes the moving arm. paper: 1 of 2 detected, after 60 ms; pretouch: 0 of 1 detected."
    ]


def test_an_experiment_without_words_says_nothing():
    assert conclusions({}) == []
