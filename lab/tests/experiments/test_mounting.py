from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.sim.scene import SceneSpec
from pretouch_lab.domain_randomisation import Misplacement, misplaced
from pretouch_lab.experiments import mounting
from pretouch_lab.experiments.mounting import ROOM, tables
from pretouch_lab.options import TrialOptions
from pretouch_lab.trial import Setup, play


def cell(side: str = "+y", position: float = 0.0, orientation: float = 0.0, told: str = "untold") -> dict:
    where = {"trajectory": "line", "side": side, "position_mm": position, "orientation_deg": orientation, "told": told}
    return where | {"profile": "paper", "restrictions": "off"}


def test_cells_are_all_errors_at_all_places_of_each_profile_that_senses():
    cells = mounting.cells(TrialOptions())
    assert {cell["profile"] for cell in cells} == {"paper"}
    off = [cell for cell in cells if cell["restrictions"] == "off" and cell["told"] == "untold"]
    assert len(off) == 6 * len(mounting.UNDECLARED)
    positions, angles = [(size, 0) for size in (5, 10, 20, 50)], [(0, size) for size in (1, 2, 5, 20)]
    assert {(cell["position_mm"], cell["orientation_deg"]) for cell in off} == {(0, 0), *positions, *angles, (3, 0.5)}
    assert {cell["side"] for cell in cells if cell["restrictions"] == "hard"} == {"-y", "+y"}
    asked = mounting.cells(TrialOptions(restrictions=("slack",)))  # in place of both
    assert {cell["restrictions"] for cell in asked} == {"slack"}
    assert len({str(cell) for cell in asked}) == len(asked)


def errors(model, skin, error, seed):
    """Shifts (7, 3) [mm] and turns (7, 3) [deg] of the units that are believed from where they sit."""
    believed, sit = misplaced(skin, model, error, seed)[0].T_link_sensor, skin.T_link_sensor
    turns = Rotation.from_matrix(np.swapaxes(sit[:, :3, :3], 1, 2) @ believed[:, :3, :3])
    return 1000 * (believed - sit)[:, :3, 3], turns.as_rotvec(degrees=True)


def test_each_unit_is_off_by_exactly_the_error_and_a_seed_gives_the_same_direction_at_every_size(
    panda_model, paper_skin
):
    for position, angle in ((0.0, 0.0), (50.0, 0.0), (0.0, 20.0), (3.0, 0.5)):
        shifts, turns = errors(panda_model, paper_skin, Misplacement(position, angle), seed=3)
        assert np.linalg.norm(shifts, axis=1) == pytest.approx(np.full(len(paper_skin), position), abs=1e-6)
        assert np.linalg.norm(turns, axis=1) == pytest.approx(np.full(len(paper_skin), angle))
    (shifts, turns), large, (others, _) = (
        errors(panda_model, paper_skin, Misplacement(size, size), seed) for size, seed in ((0.5, 2), (1.0, 2), (0.5, 4))
    )
    assert 2.0 * shifts == pytest.approx(large[0], abs=1e-6)
    assert 2.0 * turns == pytest.approx(large[1], abs=1e-9)
    assert np.abs(others - shifts).max() > 0.05


def test_a_pose_that_no_skin_file_could_hold_is_drawn_again_and_counted(panda_model, paper_skin):
    refused = [misplaced(paper_skin, panda_model, Misplacement(50.0), seed)[1] for seed in range(6)]
    assert sum(refused) > 0
    assert misplaced(paper_skin, panda_model, Misplacement(), 0)[1] == 0


def test_a_skin_file_that_tells_its_error_does_so_as_a_deviation_per_axis(panda_model, paper_skin):
    told, _ = misplaced(paper_skin, panda_model, Misplacement(3.0, 0.5, declared=True), seed=1)
    untold, _ = misplaced(paper_skin, panda_model, Misplacement(3.0, 0.5), seed=1)
    assert np.array_equal(told.T_link_sensor, untold.T_link_sensor)
    count = len(paper_skin)
    assert told.arrays.position_sigma == pytest.approx(np.full(count, 0.003 / np.sqrt(3)))
    assert told.arrays.orientation_sigma == pytest.approx(np.full(count, np.radians(0.5) / np.sqrt(3)))
    assert untold.exact


def test_directions_are_uniform_on_the_sphere(panda_model, paper_skin):
    """The mean tilt of a beam turned by a small angle about a uniform axis is pi / 4 of it."""
    tilts = []
    for seed in range(60):
        believed, _ = misplaced(paper_skin, panda_model, Misplacement(0.0, 2.0), seed)
        beams = np.sum(believed.T_link_sensor[:, :3, 2] * paper_skin.T_link_sensor[:, :3, 2], axis=1)
        tilts += np.degrees(np.arccos(beams)).tolist()
    assert np.mean(tilts) / 2.0 == pytest.approx(np.pi / 4, abs=0.04)


def one_step(setup: Setup, steps: int = 3):
    return play(setup, lambda step, _: step.stamp >= 0.2 + 0.01 * steps)


def test_units_measure_where_they_are_and_an_arm_works_and_replays_by_what_it_is_told(context, tmp_path):
    believed, _ = misplaced(context.skin, context.model, Misplacement(50.0, 20.0), seed=1)
    path = mounting.static_path("line", "+y")
    scene = mounting.static_scene("line", "+y", 25e3, 1)
    setup, place = context.setup(cell(), 1, scene, path), tmp_path / "told-wrong.mcap"
    right, wrong = one_step(setup), one_step(replace(setup, believed=believed, recording=place))
    assert wrong.steps[0].range_distance.tolist() == pytest.approx(right.steps[0].range_distance.tolist(), nan_ok=True)
    unit = int(right.steps[0].obstacles.unit[0])
    truly, taken = (
        record.steps[0].obstacles.point[record.steps[0].obstacles.unit == unit] for record in (right, wrong)
    )
    kin = context.model.kinematics(wrong.steps[0].q)
    link = context.skin.link[unit]
    beam = believed.T_link_sensor[unit] @ [0.0, 0.0, wrong.steps[0].range_distance[unit], 1.0]
    assert taken[0] == pytest.approx(kin.position[link] + kin.rotation[link] @ beam[:3], abs=1e-9)
    assert np.linalg.norm(taken - truly) > 0.01
    recorded = open_recording(place)
    assert np.array_equal(recorded.runs[0].skin.T_link_sensor, believed.T_link_sensor)
    verdict = verify(recorded)
    assert verdict.checked == len(wrong.steps)
    assert verdict.agrees


def test_an_arm_that_believes_the_truth_does_as_if_it_were_told_nothing(context):
    setup = context.setup(cell(), 2, SceneSpec(), mounting.static_path("line", "+y"))
    same = replace(setup, believed=misplaced(context.skin, context.model, Misplacement(), 2)[0])
    commands = [[s.command.tobytes() for s in one_step(s, 30).steps] for s in (setup, same)]
    assert commands[0] == commands[1]


def test_units_in_their_place_find_the_board_and_run_free_in_an_empty_room(context, monkeypatch):
    row, _ = mounting.trial(cell(), 1, context)
    assert row["contact"]
    assert row["detection_delay_s"] > 0
    assert (row["false_detections"], row["travelled_m"]) == (0, None)
    monkeypatch.setattr(mounting, "_ROOM_S", 5.0)
    row, _ = mounting.trial(cell(ROOM), 0, context)
    assert (row["contact"], row["false_detections"]) == (False, 0)
    assert row["travelled_m"] > 1.0, "0.3 m/s, but for the start"


def row(position: float, force: float, side: str = "+y", seed: int = 0, told: str = "untold") -> dict:
    board = {"impact_speed_m_s": 0.1, "detection_delay_s": 0.1}
    board |= {"filtered_at_detection_n": force, "true_peak_20ms_n": force}
    measured = dict.fromkeys(board) | {"travelled_m": force} if side == ROOM else board | {"travelled_m": None}
    counted = {"contact": side != ROOM, "false_detections": 1, "seed": seed}
    return cell(side, position, told=told) | measured | counted


def test_trials_are_compared_with_their_twin_without_error():
    rows = [row(0.0, 10.0), row(0.0, 20.0, seed=1), row(50.0, 15.0), row(50.0, 40.0, seed=1, told="told")]
    rows += [row(0.0, 5.0, ROOM), row(50.0, 4.0, ROOM), row(50.0, 12.0, side="-y")]
    forces, room = tables(rows)
    assert [r[:2] for r in forces.rows] == [("none", ""), ("50 mm", ""), ("50 mm", "yes")]
    assert [r[3] for r in forces.rows] == ["2/2", "2/2", "1/1"]
    assert [r[4] for r in forces.rows] == ["2/2", "2/2", "1/1"]
    assert [r[7] for r in forces.rows] == ["15.0", "13.5", "40.0"]
    assert [r[8] for r in forces.rows] == ["1.00", "1.50", "2.00"], "the trial at -y has no twin"
    assert forces.rows[1][-1] == "2"
    assert room.rows[1][3:] == ("80", "1")
    assert tables([]) == []
