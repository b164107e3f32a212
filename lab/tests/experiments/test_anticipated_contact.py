"""Anticipation closed over the simulated arm: a board that it runs into, and one beside its path."""

import numpy as np
import pytest
from lab.tests.experiments.test_static import cell

from pretouch.control.path import Circle
from pretouch.profiles import PROFILES
from pretouch.sim.scene import Box, SceneSpec
from pretouch.types import Mode
from pretouch_lab.experiments import static
from pretouch_lab.trial import Setup, play

SEED = 1000


@pytest.mark.slow
def test_the_arm_touches_a_board_it_sees_at_about_the_touch_speed_and_sooner_than_the_papers(context):
    rows = {}
    for profile, mode in (("blind", "off"), ("paper", "off"), ("pretouch", "braking")):
        row, record = static.trial(cell(profile, restrictions=mode), SEED, context)
        rows[profile] = row | {"touch_s": record.first_contact()}
    pretouch, paper = rows["pretouch"], rows["paper"]
    assert pretouch["impact_speed_m_s"] == pytest.approx(PROFILES["pretouch"].approach.touch_speed_m_s, abs=0.01)
    assert pretouch["true_peak_20ms_n"] < rows["blind"]["true_peak_20ms_n"] / 3
    assert pretouch["peak_estimate_n"] < rows["blind"]["peak_estimate_n"] / 3
    assert pretouch["touch_s"] < paper["touch_s"] - 1.0
    assert pretouch["false_detections"] == 0


@pytest.mark.slow
def test_beside_a_person_who_stands_still_the_arm_keeps_its_speed(panda_model, paper_skin):
    person = Box("person", (0.5, 0.77, 0.3), (0.2, 0.12, 0.5), 25_000.0)  # 0.4 m beside the circle
    path, laps = Circle(start_angle=np.pi), {}
    for name in ("paper", "pretouch"):
        setup = Setup(panda_model, paper_skin, PROFILES[name], SceneSpec(boxes=(person,)), path, SEED)
        record = play(setup, lambda step, _: step.path_phase >= path.length or step.stamp >= 20.0)
        assert record.first_contact() is None
        tracking = [step.stamp for step in record.steps if step.mode is Mode.TRACK]
        laps[name] = tracking[-1] - tracking[0]
    # 5.24 s at 0.3 m/s, and the start
    assert laps["pretouch"] < 5.7
    assert laps["paper"] > 8.0
