"""Units elsewhere than the controller believes: how they are drawn, and that an arm works by what it believes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.scene import SceneSpec
from pretouch_lab.domain_randomisation import Misplacement, misplaced
from pretouch_lab.trial import Setup, play


def errors(model, skin, error, seed):
    """Shifts (7, 3) [mm] and turns (7, 3) [deg] of the units that are believed from where they sit."""
    believed, sit = misplaced(skin, model, error, seed).T_link_sensor, skin.T_link_sensor
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


def test_directions_are_uniform_on_the_sphere(panda_model, paper_skin):
    """The mean tilt of a beam turned by a small angle about a uniform axis is pi / 4 of it."""
    tilts = []
    for seed in range(60):
        believed = misplaced(paper_skin, panda_model, Misplacement(0.0, 2.0), seed)
        beams = np.sum(believed.T_link_sensor[:, :3, 2] * paper_skin.T_link_sensor[:, :3, 2], axis=1)
        tilts += np.degrees(np.arccos(beams)).tolist()
    assert np.mean(tilts) / 2.0 == pytest.approx(np.pi / 4, abs=0.04)


def one_step(setup: Setup, steps: int = 3):
    return play(setup, lambda step, _: step.stamp >= 0.2 + 0.01 * steps)


def test_units_measure_where_they_are_and_an_arm_works_and_replays_by_what_it_is_told(context, tmp_path):
    believed = misplaced(context.skin, context.model, Misplacement(50.0, 20.0), seed=1)
    path, scene = static_path("line", "+y"), static_scene("line", "+y", 25e3, 1)
    setup, place = context.setup({"profile": "paper:approach=none"}, 1, scene, path), tmp_path / "told-wrong.mcap"
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
    setup = context.setup({"profile": "paper:approach=none"}, 2, SceneSpec(), static_path("line", "+y"))
    same = replace(setup, believed=misplaced(context.skin, context.model, Misplacement(), 2))
    commands = [[s.command.tobytes() for s in one_step(s, 30).steps] for s in (setup, same)]
    assert commands[0] == commands[1]
