"""The paper's three experiments on arms that the paper did not have."""

from dataclasses import replace

import numpy as np
import pytest
from tests.importing import made
from tests.limits import assert_within_limits
from tests.other_arm import copied_panda

from pretouch.errors import ExperimentError
from pretouch.importing.robot_import import ImportOptions, import_robot, write_folder
from pretouch.profiles import profile
from pretouch.robot.description import RobotDescription, robot_named
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sim.hand import PALM, robot_hand
from pretouch.sim.paper_scenes import placement_for
from pretouch_lab.bench.avoidance import trial
from pretouch_lab.bench.avoidance_scenes import scenarios, setting
from pretouch_lab.experiment import Context, context_of
from pretouch_lab.experiments import avoidance, dynamic
from pretouch_lab.placement import people_placement

STRONG = '<limit lower="-2.8" upper="2.8" velocity="2" effort="120"/>'
"""Limits of joints that hold such an arm outstretched."""
SHORT_S, FIRST_OVER_S = 10.0, 14.0
"""The first push, and the first visit, are over [s]."""


@pytest.fixture(scope="module")
def stranger(tmp_path_factory) -> RobotDescription:
    """A Panda that nobody knows for one: its places are found by rule."""
    return robot_named(str(copied_panda(tmp_path_factory.mktemp("stranger"))))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> str:
    place, six = tmp_path_factory.mktemp("six"), made.six_axis(changed={k: {"limit": STRONG} for k in range(1, 7)})
    write_folder(import_robot(made.written(place, six), ImportOptions()), place / "arm")
    return str(made.equipped(place / "arm"))


@pytest.fixture(scope="module")
def others(folder) -> Context:
    return context_of(folder, "", "")


def test_the_rule_finds_the_papers_places_and_about_the_hand_of_a_panda_that_it_does_not_know(stranger, panda_model):
    model = RobotModel(stranger)
    places = people_placement(model)
    assert places.scale == 1.0
    assert places.beside == pytest.approx((0.43, 0.43), abs=0.03)
    assert places.inside == pytest.approx((0.35, 0.35), abs=0.03)
    own, found = robot_hand(panda_model), robot_hand(model)
    assert own.link == panda_model.link_index("panda_hand")
    assert (own.palm.tolist(), own.turn.tolist()) == (PALM.tolist(), np.eye(3).tolist())
    kin = model.kinematics(model.description.q_ready)

    def at(hand, away):
        return kin.position[hand.link] + kin.rotation[hand.link] @ hand.beside(np.array(away))

    assert np.linalg.norm(at(found, [0, 0, 0]) - at(own, [0, 0, 0])) < 0.05
    for away in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        ours, theirs = (at(hand, away) - at(hand, [0, 0, 0]) for hand in (own, found))
        assert ours @ theirs > 0.99


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        # the hand points up, at a joint's limit
        ({"q_ready": np.array([0.0, -0.8, 0.0, -0.4, 0.0, 3.74, 0.8])}, "without a singularity or a joint limit"),
        ({"tau_max": np.full(7, 5.0)}, "panda_joint2 needs more than 80 % of its torque to hold the arm"),
    ],
)
def test_an_arm_that_cannot_follow_the_paths_is_refused_with_the_reason(stranger, changed, reason):
    with pytest.raises(ExperimentError, match=r"panda cannot follow .* in no size from 1 to 0.4") as said:
        placement_for(RobotModel(replace(stranger, **changed)))
    assert reason in str(said.value)
    assert "Give another q_ready in robot.toml" in str(said.value)


@pytest.mark.slow
def test_a_person_holds_a_hand_beside_the_circle_and_into_it(others, monkeypatch):
    monkeypatch.setattr(avoidance, "_DURATION_S", FIRST_OVER_S)
    monkeypatch.setattr(avoidance, "_SPREAD_M", 0.0)
    rows = {}
    for place in ("beside", "inside"):
        for name, mode in (("blind", "off"), ("paper", "slack")):
            cell = {"place": place, "profile": name, "restrictions": mode}
            rows[place, name], record = avoidance.trial(cell, 0, others)
            assert_within_limits(record, others.model)
    assert rows["beside", "blind"]["contact"] is False
    assert 0.01 < rows["beside", "blind"]["least_gap_m"] < 0.05  # 28 mm, but for how the arm errs
    assert rows["inside", "blind"]["contact"] is True
    assert rows["inside", "paper"]["least_speed_scale"] < 0.9


@pytest.mark.slow
def test_a_person_pushes_it(others, monkeypatch):
    monkeypatch.setattr(dynamic, "_DURATION_S", SHORT_S)
    row, record = dynamic.trial({"profile": "paper", "restrictions": "slack"}, 0, others)
    assert_within_limits(record, others.model)
    assert row["contact"] is True
    assert row["contacts"][0]["detected"] is True
    assert row["contacts"][0]["reaction_towards_person"] is False


@pytest.mark.slow
def test_the_scenarios_of_the_avoidance_benchmark_are_set_up_for_it(folder):
    for scene in scenarios().values():
        setup = setting(scene, profile("paper"), 0, folder).setup
        assert np.allclose(
            setup.model.kinematics(brought_to(setup.model, setup.path.point(0.0))).position[setup.model.ee],
            setup.path.point(0.0), atol=1e-5,
        )  # fmt: skip
    made_for_it = setting(scenarios()["person +y"], profile("paper"), 0, folder)
    path, person = made_for_it.setup.path, made_for_it.shape(np.zeros(3))
    around = np.array([path.point(s) for s in np.linspace(0, path.length, 400)])
    assert person.closest(around)[0].min() == pytest.approx(0.4, abs=1e-3)
    row = trial("", folder, {"scenario": "srdo", "contender": "pretouch"}, 0)
    assert row["duration_s"] == pytest.approx(9.0, abs=0.05)
