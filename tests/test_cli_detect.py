"""`pretouch detect`: what is printed, drawn and written."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pretouch.cli.detect import Detect
from pretouch.errors import ParameterError, PretouchError, RecordingError
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.units.skin_recording import SkinRecording
from tests.imported_data.files import PUSHES, force_columns, pushed, wrenches, write_bag, write_csv
from tests.imported_data.joint_files import Moving
from tests.units.traffic import heard


@pytest.fixture
def file(tmp_path):
    return write_csv(tmp_path / "mine.csv", force_columns(pushed(14.0, PUSHES)))


def test_what_was_read_assumed_and_found_is_printed_and_on_a_page(capsys, file, tmp_path):
    page = tmp_path / "a.html"
    Detect(file, out=page).run()
    said = capsys.readouterr().out
    assert "mine.csv: 1400 samples in 14.0 s, 100 Hz, the first at" in said
    assert (
        "assumed to be the force on the robot (otherwise --sign by-robot) in the base frame (otherwise --frame ee)"
        in said
    )
    rows = [line.split() for line in said.splitlines() if line.startswith("paper ")]
    assert [row[-1] for row in rows[:3]] == ["y", "x", "z"]
    assert "paper: 3 contacts in 0.2 min; if nobody touched the arm, 831 false alarms an hour; an F_b above" in said
    assert f"Page: {page}" in said
    assert "831 false alarms" in page.read_text()
    assert page.read_text().count("<img src=") == 1


def test_of_a_recording_of_units_it_is_said_what_can_be_done_with_it(tmp_path):
    place = tmp_path / "units.mcap"
    with SkinRecording(place) as recording:
        recording.add(heard(0.02)[:1], ["wrist"])
    with pytest.raises(
        RecordingError, match="holds samples of sensor units, but none of geometry_msgs/WrenchStamped: read it with"
    ) as caught:
        Detect(place).run()
    assert len(str(caught.value)) < 300


def test_profiles_stand_side_by_side_and_their_numbers_are_written(capsys, file, tmp_path):
    numbers, names = tmp_path / "new" / "a.json", ("paper", "paper:detect.f_base_n=31")
    Detect(file, names, json=numbers).run()
    said = capsys.readouterr().out
    assert "paper:detect.f_base_n=31: no contact in 0.2 min; an F_b above 29.6 N gives none" in said
    assert "time [s]" in said
    assert f"Numbers: {numbers}" in said
    told = json.loads(numbers.read_text())
    assert [p["profile"] for p in told["profiles"]] == list(names)
    assert [c["axes"] for c in told["profiles"][0]["contacts"]] == ["y", "x", "z"]
    assert told["rate_hz"] == pytest.approx(100.0)
    push = told["profiles"][0]["contacts"][0]
    assert push["norm_n"] == pytest.approx(np.linalg.norm(push["force_n"]))
    assert 3.0 < push["time_s"] < 3.4


def test_a_rate_is_that_of_the_detector(capsys, tmp_path):
    bag = write_bag(tmp_path / "slow", wrenches(pushed(14.0, PUSHES, rate=30.0), rate=30.0))
    Detect(bag).run()
    assert "--rate 30 runs it at the data's own rate" in capsys.readouterr().out
    numbers = tmp_path / "a.json"
    Detect(bag, rate=30.0, json=numbers).run()
    assert "repeated samples" not in capsys.readouterr().out
    assert json.loads(numbers.read_text())["profiles"][0]["control_rate_hz"] == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"profiles": ("brave",)}, ParameterError, "The profile 'brave' is unknown"),
        ({"gains": (1.0, 0.0)}, ParameterError, "--gains is 1,0"),
        ({"gains": (1.0, math.inf)}, ParameterError, "--gains is 1,inf"),
        ({"rate": 10.0}, ParameterError, "The rate is 10 Hz"),
        ({"out": Path("/dev/null/a.html")}, PretouchError, "/dev/null/a.html cannot be written"),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_is_printed(capsys, file, given, error, words):
    with pytest.raises(error, match=words) as caught:
        Detect(**{"file": file} | given).run()
    assert "\n" not in str(caught.value)
    assert capsys.readouterr().out == ""


@pytest.fixture(scope="module")
def pushed_arm(tmp_path_factory, panda_model):
    moving = Moving(panda_model, 26.0, ((22.0, 0.4, "panda_link5", (0.0, 25.0, 0.0)),))
    return moving.external_csv(tmp_path_factory.mktemp("torques") / "arm.csv"), moving


@pytest.mark.slow
def test_joint_torques_are_detected_on_by_pretouch_and_paper(capsys, pushed_arm, tmp_path):
    numbers, page = tmp_path / "a.json", tmp_path / "a.html"
    Detect(pushed_arm[0], json=numbers, out=page).run()
    said = capsys.readouterr().out
    assert "arm.csv: 13000 samples in 26.0 s, 500 Hz" in said
    assert "assumed to be on the robot (otherwise --sign by-robot). The arm is assumed to be panda (--arm)." in said
    assert "pretouch: without a skin free motion is learnt" in said
    assert "pretouch: 1 contact in 0.4 min; if nobody touched the arm, 144 false alarms an hour." in said
    assert f"Page: {page}" in said
    told = json.loads(numbers.read_text())
    assert [p["profile"] for p in told["profiles"]] == ["pretouch", "paper"]
    (contact,) = told["profiles"][0]["contacts"]
    assert 22.0 < contact["time_s"] < 22.1
    assert (contact["link"], contact["links"]) == ("panda_link5", ["panda_link5"])
    look = contact["circumstances"]
    assert f"pretouch {look['joint']}" in " ".join(said[said.index("\nAlarms\n") :].split())
    assert len(look["doing"]) == len(look["residual_nm"]) == len(look["free_motion_nm"]) == 7
    assert contact["force_n"] == pytest.approx([0.0, 25.0, 0.0], abs=4.0)
    assert len(contact["point_m"]) == 3
    assert told["profiles"][0]["largest_evidence"] < 1.0
    assert 1.0 < told["profiles"][0]["detectable_n"] < 20.0
    assert all(c["link"] is None and c["point_m"] is None for c in told["profiles"][1]["contacts"])
    text = page.read_text()
    assert text.count("<img src=") == 2
    assert "panda_link5" in text
    assert 'src="http' not in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gravity", "degrees"), [((0, 0, 1), 180), ((1, 0, 0), 90), ((0, 1, 0), 90), ((0.5, 0, -(0.75**0.5)), 30)]
)
def test_an_arm_detects_as_a_standing_one_does_however_it_is_mounted(capsys, tmp_path, gravity, degrees):
    model = RobotModel(replace(panda(), gravity=np.array(gravity)))
    arm, numbers = Moving(model, 12.0, ((9.0, 0.4, "panda_link5", (0.0, 25.0, 0.0)),), rate=100.0), tmp_path / "a.json"
    Detect(arm.raw_csv(tmp_path / "a.csv"), ("pretouch",), json=numbers).run()
    out = capsys.readouterr().out
    assert any(f"in the base frame, {degrees + off} degrees from where the arm's" in out for off in (-1, 0, 1))
    (contact,) = json.loads(numbers.read_text())["profiles"][0]["contacts"]
    assert (contact["link"], contact["time_s"]) == ("panda_link5", pytest.approx(9.05, abs=0.05))


def test_with_a_force_beside_torques_each_can_be_had(capsys, pushed_arm, tmp_path):
    _, moving = pushed_arm
    kinds = (("q*_rad", moving.q), ("tau_ext*_Nm", moving.tau_ext))
    columns = moving.columns(*kinds) | {f"force_{axis}_N": np.zeros(len(moving.time)) for axis in "xyz"}
    both = write_csv(tmp_path / "both.csv", columns)
    Detect(both, profiles=("paper",)).run()
    assert "Force from force_x_N, assumed" in capsys.readouterr().out
    Detect(both).run()
    assert (
        "External torques, from tau_ext1_Nm, positions from q1_rad, assumed to be on the robot"
        in capsys.readouterr().out
    )
    del columns["q7_rad"]
    write_csv(tmp_path / "six.csv", columns)
    with pytest.raises(RecordingError, match="are not the 7 joints of panda"):
        Detect(tmp_path / "six.csv", profiles=("pretouch",)).run()
    with pytest.raises(RecordingError, match="gives only a force: choose one with"):
        Detect(write_csv(tmp_path / "force.csv", force_columns(pushed(5.0, ()))), profiles=("pretouch",)).run()
