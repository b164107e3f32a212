"""`pretouch bench calibration`: random skins calibrated in simulation."""

import json

import pytest
from lab.tests.studies.calibration.test_study import row

from pretouch import cli
from pretouch_lab.studies.calibration import study as study_module
from pretouch_lab.studies.calibration.study import Study

ROW = row("panda_hand", 0.0002)


def calibrate(*words):
    return cli.main(["bench", "calibration", *map(str, words)])


def test_the_study_is_asked_as_said_and_its_rows_are_written(tmp_path, capsys, monkeypatch):
    asked = []

    def study(model, skins, seed, links_known, plan, progress):
        asked.append((model.description.name, skins, seed, links_known, plan))
        progress()
        return Study([ROW], 60.0, 1.5)

    monkeypatch.setattr(study_module, "study", study)
    place = tmp_path / "new" / "rows.json"
    for _ in range(2):
        assert calibrate("--skins", 20, "--json", place) == 0
        assert asked.pop() == ("panda", 20, 0, True, None)
    told = json.loads(place.read_text())
    assert told["rows"] == [ROW]
    assert (told["motion_s"], told["compute_s"]) == (60.0, 1.5)
    said = capsys.readouterr().out
    assert "Where units sit, found in 60 s of motion" in said
    assert "panda_hand" in said
    assert f"Numbers: {place}" in said
    assert calibrate("--find-links", "--seed", 3, "--arm", "fr3") == 0
    assert asked == [("fr3", 20, 3, False, None)]


@pytest.mark.slow
def test_a_study_of_two_skins_finds_all_units_to_a_millimetre(tmp_path):
    place = tmp_path / "rows.json"
    assert calibrate("--skins", 2, "--find-links", "--swing-s", 9, "--json", place) == 0
    told = json.loads(place.read_text())
    assert [unit["skin"] for unit in told["rows"]] == 7 * [0] + 7 * [1]
    assert told["motion_s"] < 55.0
    for unit in told["rows"]:
        assert unit["position_error_m"] < 0.001
        assert unit["orientation_error_deg"] < 0.1
