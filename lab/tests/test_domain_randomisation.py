from dataclasses import replace

import pytest

from pretouch.errors import ExperimentError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch_lab.cli import benchmarks
from pretouch_lab.domain_randomisation import Parts, folder_part, randomised, sentence
from pretouch_lab.experiment import arguments, context_of
from pretouch_lab.experiments import static
from pretouch_lab.options import DetectionOptions, TrialOptions
from pretouch_lab.run import open_run

MODEL = RobotModel(panda())
PARTS = Parts(PlantParams(), RangeFinderParams(), paper_skin(MODEL), None)


def test_a_world_changes_arm_sensors_and_what_is_believed_of_the_skin():
    assert randomised("", 1001, MODEL, PARTS) is PARTS
    parts = randomised("realistic", 1001, MODEL, PARTS)
    assert parts.plant != PARTS.plant
    assert parts.ranging != PARTS.ranging
    assert parts.skin is PARTS.skin
    assert (parts.believed.T_link_sensor != PARTS.skin.T_link_sensor).any()
    again = randomised("realistic", 1001, MODEL, PARTS)
    assert again.plant == parts.plant
    assert (again.believed.T_link_sensor == parts.believed.T_link_sensor).all()
    told = replace(PARTS, believed=paper_skin(MODEL))  # as an experiment tells it, which stays
    assert randomised("stress", 1001, MODEL, told).believed is told.believed


def test_the_nominal_world_plays_as_the_usual_one():
    context, cell = context_of("", "", ""), static.cells(TrialOptions())[0]
    usual, _ = static.trial(cell, 1003, context)
    assert static.trial(cell, 1003, replace(context, world="nominal"))[0] == usual
    assert static.trial(cell, 1003, replace(context, world="realistic"))[0] != usual


def test_runs_of_two_worlds_and_of_a_file_that_changed_do_not_share_a_folder(tmp_path):
    open_run(tmp_path / "a", arguments("static", TrialOptions()))
    with pytest.raises(ExperimentError, match="holds a run with world = '', not 'stress'"):
        open_run(tmp_path / "a", arguments("static", TrialOptions(world="stress")))
    out = str(tmp_path / "b")
    benchmarks._folder(DetectionOptions(out=out, world="stress"), "detection")
    with pytest.raises(ExperimentError, match="holds a run with world = 'stress', not ''"):
        benchmarks._folder(DetectionOptions(out=out), "detection")
    place = tmp_path / "mine.toml"
    place.write_text("[plant.mass_error]\nvalue = 0.1\n")
    open_run(tmp_path / "run", arguments("static", TrialOptions(world=str(place))))
    place.write_text("[plant.mass_error]\nvalue = 0.2\n")
    with pytest.raises(ExperimentError, match="holds a run with world_sha256 = "):
        open_run(tmp_path / "run", arguments("static", TrialOptions(world=str(place))))


def test_folders_are_named_by_their_world(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (
        benchmarks._folder(DetectionOptions(world="stress", quick=True), "detection").name
        == "bench-detection-stress-quick"
    )
    assert benchmarks._folder(DetectionOptions(), "detection").name == "bench-detection"
    assert folder_part("") == sentence("") == ""
    assert folder_part("here/arm.toml") != folder_part("there/arm.toml")
