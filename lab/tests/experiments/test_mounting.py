from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from lab.tests.width import width
from scipy.spatial.transform import Rotation

from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.robot.description import panda
from pretouch.sim.random_skin import Misplacement, misplaced
from pretouch.sim.scene import Box, SceneSpec
from pretouch.types import no_obstacles
from pretouch_lab.experiments import mounting
from pretouch_lab.experiments.mounting import EXACT, ROOM, tables
from pretouch_lab.options import Options
from pretouch_lab.trial import Setup, play


def cell(side: str = "+y", position: float = 0.0, orientation: float = 0.0, told: str = "untold") -> dict:
    where = {"trajectory": "line", "side": side, "position_mm": position, "orientation_deg": orientation, "told": told}
    return where | {"profile": "paper", "restrictions": "off"}


def test_cells_are_all_errors_at_all_places_of_each_profile_that_senses():
    cells = mounting.cells(Options())
    assert {cell["profile"] for cell in cells} == {"paper"}
    off = [cell for cell in cells if cell["restrictions"] == "off" and cell["told"] == "untold"]
    assert len(off) == 6 * len(mounting.UNTOLD)
    positions = [(size, 0) for size in (2, 5, 10, 20, 30, 50)]
    angles = [(0, size) for size in (1, 2, 5, 10, 20)]
    assert {(cell["position_mm"], cell["orientation_deg"]) for cell in off} == {
        (0, 0),
        *positions,
        *angles,
        (1, 0.1),
        (3, 0.5),
    }
    assert {cell["side"] for cell in cells if cell["restrictions"] == "hard"} == {"-y", "+y"}
    asked = mounting.cells(Options(restrictions=("slack",)))  # in place of both
    assert {cell["restrictions"] for cell in asked} == {"slack"}
    assert len({str(cell) for cell in asked}) == len(asked)


def errors(model, skin, error, seed):
    """Shifts (7, 3) [mm] and turns (7, 3) [deg] of the units that are believed from where they sit."""
    believed, sit = misplaced(skin, model, error, seed)[0].T_link_sensor, skin.T_link_sensor
    turns = Rotation.from_matrix(np.swapaxes(sit[:, :3, :3], 1, 2) @ believed[:, :3, :3])
    return 1000 * (believed - sit)[:, :3, 3], turns.as_rotvec(degrees=True)


@pytest.mark.parametrize(("position", "angle"), [(0.0, 0.0), (50.0, 0.0), (0.0, 20.0), (3.0, 0.5)])
def test_each_unit_is_off_by_exactly_the_error(panda_model, paper_skin, position, angle):
    shifts, turns = errors(panda_model, paper_skin, Misplacement(position, angle), seed=3)
    assert np.linalg.norm(shifts, axis=1) == pytest.approx(np.full(len(paper_skin), position), abs=1e-6)
    assert np.linalg.norm(turns, axis=1) == pytest.approx(np.full(len(paper_skin), angle))


def test_the_same_seed_gives_the_same_direction_at_every_size(panda_model, paper_skin):
    (shifts, turns), large, (others, _) = (
        errors(panda_model, paper_skin, Misplacement(size, size), seed) for size, seed in ((0.5, 2), (1.0, 2), (0.5, 4))
    )
    assert 2.0 * shifts == pytest.approx(large[0], abs=1e-6)
    assert 2.0 * turns == pytest.approx(large[1], abs=1e-9)
    assert np.abs(others - shifts).max() > 0.05


def test_a_pose_that_no_skin_file_could_hold_is_drawn_again_and_counted(panda_model, paper_skin):
    refused = [misplaced(paper_skin, panda_model, Misplacement(50.0), seed)[1] for seed in range(6)]
    assert sum(refused) > 0
    assert misplaced(paper_skin, panda_model, EXACT, 0)[1] == 0


def test_a_skin_file_that_tells_its_error_does_so_as_a_deviation_per_axis(panda_model, paper_skin):
    told, _ = misplaced(paper_skin, panda_model, Misplacement(3.0, 0.5, told=True), seed=1)
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
    same = replace(setup, believed=misplaced(context.skin, context.model, EXACT, 2)[0])
    commands = [[s.command.tobytes() for s in one_step(s, 30).steps] for s in (setup, same)]
    assert commands[0] == commands[1]


def test_the_least_gap_is_that_of_mujoco(panda_model):
    """Both shapes are convex, and MuJoCo finds their distance in another way."""
    box = Box("object", (0.5, 0.35, 0.4), (0.15, 0.02, 0.12), 25e3)
    spec = mujoco.MjSpec.from_file(str(panda().mjcf))
    spec.worldbody.add_geom(
        name="object", type=mujoco.mjtGeom.mjGEOM_BOX, pos=box.center, size=box.half_size, contype=1, conaffinity=1
    )
    model = spec.compile()
    data, rng = mujoco.MjData(model), np.random.default_rng(8)
    moved = {panda_model.links[i] for i in panda_model.body.link}
    geoms = [g for g in range(model.ngeom) if model.body(int(model.geom_bodyid[g])).name in moved]
    for _ in range(20):
        q = rng.uniform(panda_model.q_min, panda_model.q_max)
        data.qpos[: panda_model.n] = q
        mujoco.mj_kinematics(model, data)
        target = model.geom("object").id
        found = min(mujoco.mj_geomDistance(model, data, g, target, 2.0, None) for g in geoms)
        ours = mounting.least_gap(SimpleNamespace(steps=[SimpleNamespace(q=q)]), panda_model, box)
        assert ours == pytest.approx(found, abs=1e-3) or (ours < 0 and found < 0)


@pytest.fixture(scope="module")
def exact(context):
    """A trial with all units in their place."""
    return mounting.trial(cell(), 1, context)


def test_units_in_their_place_miss_nothing(exact):
    row, record = exact
    assert row["missed_fraction"] < 0.01
    assert row["contact"]
    assert row["detected"]
    assert row["touch_s"] == record.first_contact()
    assert -0.01 < row["least_gap_m"] < 0.002


def test_readings_that_are_taken_for_nothing_are_missed(exact, context):
    _, record = exact
    scene = mounting.static_scene("line", "+y", 25e3, 1)
    setup = context.setup(cell(), 1, scene, mounting.static_path("line", "+y"))
    seen = [s for s in record.steps if len(s.obstacles.unit)]
    cut = replace(record, steps=[copy(step) for step in seen])
    for step in cut.steps[1::2]:
        step.obstacles = no_obstacles()
    assert mounting.missed(cut, setup) == pytest.approx(0.5, abs=0.05)
    assert mounting.missed(replace(record, steps=[]), setup) is None


def test_in_an_empty_room_an_arm_with_units_in_their_place_runs_free(context, monkeypatch):
    monkeypatch.setattr(mounting, "_ROOM_S", 5.0)
    row, _ = mounting.trial(cell(ROOM), 0, context)
    assert (row["obstacle_fraction"], row["speed_scale"], row["false_detections"]) == (0.0, 1.0, 0)
    assert row["travelled_m"] > 0.7
    assert row["least_gap_m"] is None


def row(position: float, force: float, side: str = "+y", seed: int = 0, told: str = "untold") -> dict:
    empty = side == ROOM
    board = {"impact_speed_m_s": 0.1, "missed_fraction": 0.1, "least_gap_m": 0.0}
    board |= {"filtered_at_detection_n": force, "true_peak_20ms_n": force}
    room = {"obstacle_fraction": 0.2, "speed_scale": 0.9, "travelled_m": force}
    counted = {"contact": not empty, "false_detections": 1, "refused": 1, "drawn": 8, "seed": seed}
    measured = dict.fromkeys(board) | room if empty else dict.fromkeys(room) | board
    return cell(side, position, told=told) | measured | counted


def test_trials_are_compared_with_their_twin_without_error():
    rows = [row(0.0, 10.0), row(0.0, 20.0, seed=1), row(50.0, 15.0), row(50.0, 40.0, seed=1, told="told")]
    rows += [row(0.0, 5.0, ROOM), row(50.0, 4.0, ROOM), row(50.0, 12.0, side="-y")]
    rows.append(row(50.0, 4.0, ROOM, seed=1) | {"refused": 9, "drawn": 16})
    forces, room = tables(rows)
    assert [r[:2] for r in forces.rows] == [("none", ""), ("50 mm", ""), ("50 mm", "yes")]
    assert [r[3] for r in forces.rows] == ["2/2", "2/2", "1/1"]
    assert [r[7] for r in forces.rows] == ["15.0", "13.5", "40.0"]
    assert [r[8] for r in forces.rows] == ["1.00", "1.50", "2.00"], "the trial at -y has no twin"
    assert forces.rows[1][-1] == "2"
    assert room.rows[1][5] == "80"
    assert room.rows[1][-1] == "42", "10 of 24 poses were refused"
    assert max(width(table) for table in (forces, room)) <= 80
    assert tables([]) == []
