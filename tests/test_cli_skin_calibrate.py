"""`pretouch skin calibrate`: what goes together, and the motion for one's own driver."""

import csv
import re
import socket
from unittest.mock import Mock

import numpy as np
import pytest

from pretouch import cli
from pretouch.arms.simulated import arm
from pretouch.arms.simulated.arm import SimulatedArm
from pretouch.calibration.motion.limits import PlanLimits
from pretouch.imported_data.reading import read_joints
from pretouch.robot.postures import capsule_ends, kinematics_of
from pretouch.units.fleet import simulated_keys
from pretouch.units.keys import save_keys

ASIDE = np.array([-1.2, 0, 0, 0, 0, 0, 0])
"""From the ready posture to where the arm of a test stands [rad]: to its right."""


def calibrate(*words):
    return cli.main(["skin", "calibrate", *map(str, words)])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "give --recording FILE or --plan FILE, or name an arm, as in `pretouch skin calibrate simulated`."),
        (("--plan", "m.csv", "--recording", "x"), "--recording and --plan are given: choose one of them."),
        (("--recording", "x.mcap", "--swing-s", "8"), "Options of the motion do not go with --recording"),
        (("--plan", "m.csv", "--out", "s.toml"), "Options of a recording, or --out do not go with --plan"),
        (("--recording", "joints.csv"), "give the recording with --recording, and joint states with --joints."),
        (("--recording", "/nowhere.mcap"), "The recording /nowhere.mcap cannot be read: it does not exist."),
        (("--recording", "x.mcap", "--skin", "/nowhere.toml"), "/nowhere.toml cannot be read"),
        (("--recording", "x.mcap", "--out", "/dev/null/x.toml"), "/dev/null/x.toml cannot be written"),
        (("--recording", "x.mcap", "--json", "/dev/null/x.json"), "/dev/null/x.json cannot be written"),
        (("--plan", "/dev/null/m.csv"), "/dev/null/m.csv cannot be written"),
        (("fr3", "--out", "s.toml"), "No arm to move is called 'fr3'"),
        (("simulated",), "--out is missing: name the skin file to write."),
        (("franka", "--ip", "1.2.3.4", "--out", "s.toml"), "give the file of their keys with --keys"),
        (("simulated", "--out", "s.toml", "--units-host", ""), "--units-host is empty"),
        (("simulated", "--out", "s.toml", "--seed", "-1"), "--seed is -1"),
        (("simulated", "--out", "s.toml", "--record", "/dev/null/x.mcap"), "x.mcap cannot be written"),
    ],
)
def test_what_makes_no_sense_is_said_in_one_sentence(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert calibrate(*words) == 2
    told = capsys.readouterr()
    assert said in told.err
    assert told.err.count("\n") == 1
    assert "planned" not in told.out


def test_files_that_are_there_are_not_written_over_unasked(tmp_path, capsys):
    there = tmp_path / "there"
    there.write_text("mine")
    for words in (
        ("--recording", "x.mcap", "--out", there),
        ("--plan", there),
        ("--recording", "x.mcap", "--json", there),
        ("simulated", "--out", there),
        ("simulated", "--out", tmp_path / "s.toml", "--json", there),
    ):
        assert calibrate(*words) == 2
        assert f"{there} exists already: give another name, or --replace." in capsys.readouterr().err
    assert calibrate("simulated", "--out", tmp_path / "s.toml", "--record", there, "--replace") == 2
    assert capsys.readouterr().err == f"The recording {there} exists already: give another file to --record.\n"
    assert there.read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        ("--recording", "mine", "--json", "mine"), ("--recording", "mine", "--out", "./mine"),
        ("--recording", "mine", "--out", "link"), ("--recording", "x", "--joints", "mine", "--out", "mine"),
        ("--recording", "x", "--joints", "bag", "--json", "bag/mine"),
        ("--recording", "x", "--skin", "mine", "--json", "mine"), ("--recording", "x", "--out", "new", "--json", "new"),
        ("simulated", "--out", "new", "--record", "new"),
        ("simulated", "--out", "s", "--keys", "mine", "--json", "mine"),
    ],
)  # fmt: skip
def test_no_file_is_written_over_another_one_of_the_same_command(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bag").mkdir()
    for place in (tmp_path / "mine", tmp_path / "bag" / "mine"):
        place.write_text("mine")
    (tmp_path / "link").symlink_to("mine")
    assert calibrate(*words, "--replace") == 2
    assert "is also another input or output file: give another name." in capsys.readouterr().err
    assert (tmp_path / "mine").read_text() == (tmp_path / "bag" / "mine").read_text() == "mine"


def test_a_port_that_is_taken_is_said_before_anything_is_planned(paper_skin, tmp_path, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
        save_keys(simulated_keys(paper_skin.ids, 0), tmp_path / "k.toml")
        files = ("--keys", tmp_path / "k.toml", "--out", tmp_path / "s.toml")
        assert calibrate("simulated", *files, "--units-port", port) == 2
    told = capsys.readouterr()
    assert f"Port {port} of 127.0.0.1 is in use" in told.err
    assert "planned" not in told.out


@pytest.mark.slow
def test_the_arm_does_not_move_without_a_persons_word(tmp_path, capsys, monkeypatch):
    files = ("--out", tmp_path / "s.toml")
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    for answer in ("", "n", "maybe", EOFError):
        monkeypatch.setattr("builtins.input", Mock(side_effect=[answer]))
        assert calibrate("simulated", *files) == 2
        told = capsys.readouterr()
        assert "The arm needs the space x" in told.out
        assert "While the arm moves, nobody may be within its reach" in told.out
        assert "The arm was not moved: answer y to allow it." in told.err

    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    assert calibrate("simulated", *files) == 2
    assert "There is no terminal to ask for permission to move the arm: give --yes." in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_way_to_the_start_is_part_of_what_is_asked_about(panda_model, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(arm, "SimulatedArm", lambda model, q, *words: SimulatedArm(model, q + ASIDE, *words))
    questions = []
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda question: questions.append(question) or "n")
    assert calibrate("simulated", "--out", tmp_path / "s.toml", "--poses", 2) == 2
    said = capsys.readouterr().out
    lasts = int(re.search(r"^(\d+) s; parts", said, re.MULTILINE)[1])
    told = re.search(r"moving to its start takes (\d+) s and needs the space x (\S+) to .*, y (\S+) to", said)
    assert told
    assert abs(int(re.findall(r"\d+", questions[0])[0]) - lasts - int(told[1])) <= 1
    body = panda_model.capsules
    ends = capsule_ends(panda_model, kinematics_of(panda_model, (panda_model.description.q_ready + ASIDE)[None]))
    assert float(told[3]) < (ends - body.radius[:, None, None])[..., 1].min() + 0.01
    assert float(told[3]) < float(re.search(r"The arm needs the space .*, y (\S+) to", said)[1])


def test_the_motion_is_written_for_another_driver_and_then_the_room_it_takes(
    panda_model, tmp_path, capsys, monkeypatch
):
    place, report = tmp_path / "motion.csv", PlanLimits.report
    # though nobody reads on: a closed pipe ends the command
    monkeypatch.setattr(PlanLimits, "report", lambda *given: place.stat().st_size and report(*given))
    assert calibrate("--plan", place, "--poses", 2) == 0
    said = capsys.readouterr().out
    assert said.index(" s; parts move") < said.index("The arm needs the space") < said.index("Keep everybody out of")
    with place.open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["time_s", *(f"q{i}_rad" for i in range(1, 8)), *(f"qd{i}_rad_s" for i in range(1, 8))]
    np.testing.assert_allclose(read_joints(place, panda_model)[0].q, np.array(rows[1:], dtype=float)[:, 1:8])
    table = np.array(rows[1:], dtype=float)
    assert f"{table[-1, 0]:.0f} s; parts move" in said
    assert np.diff(table[:, 0]).max() <= 0.001 + 1e-6
    for row in table[[0, -1]]:
        assert row[1:8] == pytest.approx(panda_model.description.q_ready, abs=1e-6)
        assert row[8:] == pytest.approx(np.zeros(7), abs=1e-6)
