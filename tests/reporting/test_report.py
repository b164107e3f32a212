"""The command, on files that the recorder wrote."""

import os
from dataclasses import replace

import pytest

from pretouch import cli
from pretouch.cli.report import WriteReport
from pretouch.controller import Controller
from pretouch.errors import ExperimentError
from pretouch.loop import Cycle
from pretouch.profiles import profile
from pretouch.recording.reader import open_recording
from pretouch.recording.writer import Recording
from pretouch.reporting.health import health_section
from pretouch.reporting.measures import limit_section, measure, mode_section
from pretouch.sim.scene import SceneSpec, fixtures


@pytest.fixture(scope="module")
def folder(touched, panda_model, paper_skin, tmp_path_factory):
    """A folder with a recording of a trial whose profile changes after 3 s, and what was recorded."""
    place = tmp_path_factory.mktemp("recordings")
    played = replace(touched, runs=(replace(touched.runs[0], profile=profile("blind")),))
    fixed, path = fixtures(SceneSpec()), played.runs[0].path
    before = Controller(panda_model, paper_skin, fixed, path, profile("blind"))
    state = before.init(played[0].inputs.robot)
    with Recording(place / "trial.mcap", before, {"command": "test"}) as recording:
        for i, kept in enumerate(played):
            if i == 300:
                changed = profile("blind:detect.f_base_n=9")
                recording.change(Controller(panda_model, paper_skin, fixed, path, changed))
            recording.record(Cycle(kept.inputs, state, kept.step, state), kept.truth)
    return place, played


def written(file, out, overwrite=False):
    """The page that the command writes."""
    WriteReport(file, out, overwrite).run()
    return out.read_text()


def test_a_report_of_a_file_is_that_of_what_was_recorded(folder):
    place, played = folder
    told, expected = measure(open_recording(place / "trial.mcap"), ""), measure(played, "")
    assert len(expected.contacts.detections) == len(expected.contacts.touches) == 1
    assert told.contacts.delays == expected.contacts.delays
    assert told.contacts.touches[0].peak == expected.contacts.touches[0].peak
    for section in (health_section, mode_section, limit_section):
        assert section(told.course) == section(expected.course)


@pytest.mark.slow
def test_the_command_writes_a_page(folder, tmp_path, capsys):
    place, _ = folder
    out = tmp_path / "new" / "page.html"
    assert cli.main(["report", str(place / "trial.mcap"), "--out", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    text = out.read_text()
    assert "trial.mcap" in text
    assert "blind:detect.f_base_n=9" in text


def test_a_killed_file_makes_a_page_that_says_so(folder, tmp_path):
    place, _ = folder
    whole = (place / "trial.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: 2 * len(whole) // 3])
    said = open_recording(cut).sentence
    assert said
    text = written(cut, tmp_path / "cut.html")
    assert '<span class="bad">' in text
    assert said.replace("&", "&amp;").split("'")[0][:40] in text


def test_what_is_wrong_with_a_request_is_one_sentence(folder, tmp_path):
    trial, out = folder[0] / "trial.mcap", tmp_path / "page.html"
    with pytest.raises(ExperimentError, match="is also another input or output file: give another name"):
        written(trial, trial, overwrite=True)
    with pytest.raises(ExperimentError, match="cannot be written"):
        written(trial, tmp_path)
    out.write_text("notes of my own")
    with pytest.raises(ExperimentError, match="exists already: give another name, or --replace"):
        written(trial, out)
    assert "</html>" in written(trial, out, overwrite=True)


def test_a_name_that_is_no_text_can_be_reported(folder, tmp_path):
    odd = tmp_path / os.fsdecode(b"odd\xff.mcap")
    odd.write_bytes((folder[0] / "trial.mcap").read_bytes())
    assert "odd?.mcap" in written(odd, tmp_path / "page.html")
