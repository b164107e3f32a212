from dataclasses import replace

import pytest

from pretouch.control.path import Circle
from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch.sim.scene import SceneSpec
from pretouch_lab.cli import benchmarks
from pretouch_lab.domain_randomisation import folder_part, sentence
from pretouch_lab.experiment import arguments, context_of
from pretouch_lab.experiments import static
from pretouch_lab.options import DetectionOptions, TrialOptions
from pretouch_lab.run import open_run
from pretouch_lab.trial import Setup, randomised


def test_a_world_changes_arm_sensors_and_what_is_believed_of_the_skin(panda_model, paper_skin):
    plain = Setup(panda_model, paper_skin, profile("paper"), SceneSpec(), Circle(), 1001)
    assert randomised(plain) is plain
    setup = randomised(replace(plain, world="realistic"))
    assert setup.plant != plain.plant
    assert setup.ranging != plain.ranging
    assert setup.skin is plain.skin
    assert (setup.believed.T_link_sensor != plain.skin.T_link_sensor).any()
    again = randomised(replace(plain, world="realistic"))
    assert again.plant == setup.plant
    assert (again.believed.T_link_sensor == setup.believed.T_link_sensor).all()
    assert randomised(replace(plain, believed=paper_skin, world="stress")).believed is paper_skin


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
