"""The study of the camera beside the skin: its cells, numbers and table, and what the arm hides from a camera."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.perception.closest import no_obstacles
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.studies import vision

HAND = 0.05


def test_only_profiles_that_take_points_are_given_a_camera():
    cells = vision.cells(Grid(("paper", "blind", "pretouch")))
    counts = {name: sum(cell.profile == name for cell in cells) for name in ("paper", "blind", "pretouch")}
    assert counts == {"paper": 3, "blind": 0, "pretouch": 15}
    assert all((c.where["view"] == "none") == (c.where["sensing"] == "skin") for c in cells)


def record(model, points, hand):
    """An arm that stands in its ready posture for a tenth of a second for each set of sensed points (K, 3)."""
    q = model.description.q_ready
    ee = model.kinematics(q).position[model.ee]
    steps = []
    for k, point in enumerate(points):
        near = no_obstacles()
        near.point, near.body_distance = point, np.full(len(point), 0.2)
        steps.append(SimpleNamespace(stamp=0.1 * k, q=q, ee_position=ee, path_phase=0.03 * k, obstacles=near))
    return SimpleNamespace(
        steps=steps, hand_position=np.tile(hand, (len(steps), 1)), held=lambda: False, times=lambda: np.array(
            [s.stamp for s in steps]
        ), first_contact=lambda: None, true_force=np.zeros((10, 3)), true_time=np.arange(10) / 1000.0, touches=[],
    )  # fmt: skip


def test_numbers_of_a_trial_by_hand(panda_model):
    hand = np.array([0.30689, 0.3, 0.53])
    none, shown, wrong = np.zeros((0, 3)), hand[None] - [0.0, HAND, 0.0], hand[None] + [0.0, 0.0, 0.5]
    made = record(panda_model, [none, shown, wrong, np.vstack((shown, wrong))], hand)
    row = vision.results(made, vision.scene_of("hand", 1000), panda_model, 0.8)
    assert row["seen_fraction"] == 0.5
    assert row["false_fraction"] == 0.5
    assert (row["way_m"], row["contact"], row["seen_before_s"]) == (0.09, False, None)
    assert row["first_seen_m"] == row["least_distance_m"] == pytest.approx(0.15, abs=0.01)
    empty = vision.results(made, vision.scene_of("room", 1000), panda_model, 0.8)
    assert empty["false_fraction"] == 0.75
    assert empty["seen_fraction"] is None


def test_all_of_it_is_in_the_table(panda_model):
    made = record(panda_model, [np.zeros((0, 3))] * 2, np.array([0.3, 1.5, 0.5]))
    rows = []
    for cell in vision.cells(Grid(("pretouch",))):
        found = vision.results(made, vision.scene_of(str(cell.where["scene"]), 1000), panda_model, 0.8)
        rows.append({"experiment": "vision", **cell.where, "profile": cell.profile, "seed": 1000} | found)
    (table,) = vision.tables(vision.summarise(rows))
    assert len(table.rows) == 15
    assert {len(row) for row in table.rows} == {len(table.header)}


@pytest.mark.slow
def test_the_arm_hides_a_hand_from_the_camera_and_the_skin_still_sees_what_comes_near(panda_model, paper_skin):
    context = Context(panda_model, paper_skin)

    def played(scene: str, sensing: str, view: str):
        where = {"scene": scene, "sensing": sensing, "view": view, "restrictions": "braking"}
        return vision.trial(Cell("vision", "pretouch", where), 1000, context)[0]

    front, behind = (played("hand", "camera", view) for view in ("front", "behind"))
    both = played("hand", "both", "behind")
    assert front["seen_fraction"] > 0.7
    assert behind["seen_fraction"] < 0.5 * front["seen_fraction"]
    assert both["seen_fraction"] > behind["seen_fraction"] + 0.1
    room = played("room", "both", "front")
    assert room["false_fraction"] < 0.01
    board = played("board", "both", "behind")
    assert board["seen_fraction"] > 0.9
