"""`pretouch skin calibrate --recording`: from what was recorded to a skin file."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from pretouch import cli
from pretouch.calibration.calibrate import BOARD_MISALIGNMENT_DEG
from pretouch.cli.calibrate import recorded as recording_way
from pretouch.imported_data.reading import read_joints
from pretouch.sensing.skin import Skin, load_skin, save_skin
from pretouch.traces import JointTrace
from pretouch.units.skin_recording import SkinRecording, read_skin
from tests.calibrated_arm import assert_same_places, record_motion

pytestmark = pytest.mark.slow

LATE = 1.7e9
"""Of the joints' clock in a file of their own [s]: the time of day against a monotonic clock."""


@pytest.fixture(scope="module")
def skin(panda_model, paper_skin):
    units = {unit.id: unit for unit in paper_skin.units}
    return Skin([units[name] for name in ("forearm_left", "hand_left", "hand_front")], panda_model)


@pytest.fixture(scope="module")
def recorded(panda_model, skin, tmp_path_factory):
    """A folder with `units.mcap`, all in one, and `joints.csv`, the joint states by another clock."""
    folder = tmp_path_factory.mktemp("recorded")
    joints = record_motion(panda_model, skin, folder / "units.mcap")
    with (folder / "joints.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", *(f"q{i}_rad" for i in range(1, 8))])
        rows.writerows([f"{t + LATE:.6f}", *q] for t, q in zip(joints.stamp, joints.q.tolist(), strict=True))
    return folder


@pytest.fixture
def read_as(recorded, monkeypatch, panda_model):
    """Have the recording read as if some of it were otherwise; `whole` is all of it."""

    def changed(flipped=False, **changes):
        monkeypatch.setattr(recording_way, "read_skin", lambda place: replace(changed.whole, **changes))
        if flipped:
            trace, log = read_joints(recorded / "units.mcap", panda_model)
            joints = JointTrace(trace.stamp, np.flip(trace.q, axis=0))
            monkeypatch.setattr(recording_way, "read_joints", lambda *_: (joints, log))

    changed.whole = read_skin(recorded / "units.mcap")
    return changed


def calibrate(*words):
    return cli.main(["skin", "calibrate", *map(str, words)])


def test_a_recording_of_units_and_joints_becomes_a_skin_file(panda_model, skin, recorded, tmp_path, capsys):
    out, numbers = tmp_path / "skin.toml", tmp_path / "numbers.json"
    assert calibrate("--recording", recorded / "units.mcap", "--out", out, "--json", numbers) == 0
    said = capsys.readouterr().out
    assert f"Skin file: {out} has 3 units where they were found." in said
    made = load_skin(out, panda_model)
    assert sorted(made.ids) == sorted(skin.ids)
    assert_same_places(made, skin)
    told = json.loads(numbers.read_text())
    assert told["clock_ahead_s"] == 0.0
    for unit in told["units"]:
        place, written = unit["place"], made.units[made.ids.index(unit["id"])]
        assert unit["accepted"]
        np.testing.assert_allclose(place["T_link_sensor"], written.T_link_sensor, atol=1e-9)
        assert place["position_sigma"] == pytest.approx(written.position_sigma)
        askew = np.deg2rad(BOARD_MISALIGNMENT_DEG)
        assert written.orientation_sigma == pytest.approx(np.hypot(place["orientation_sigma"], askew))
        assert np.array(place["covariance"]).shape == (6, 6)
        assert unit["id"] in said


def test_joint_states_of_another_clock_are_aligned(panda_model, skin, recorded, tmp_path, capsys):
    out, numbers = tmp_path / "skin.toml", tmp_path / "numbers.json"
    words = ("--joints", recorded / "joints.csv", "--out", out, "--json", numbers)
    assert calibrate("--recording", recorded / "units.mcap", *words) == 0
    said = capsys.readouterr().out
    assert f"Joint states are q1_rad of {recorded / 'joints.csv'}." in said
    assert f"s behind that of {recorded / 'joints.csv'}." in said
    assert "no other unit agrees" not in said
    assert_same_places(load_skin(out, panda_model), skin)
    told = json.loads(numbers.read_text())
    assert told["clock_ahead_s"] == pytest.approx(-LATE, abs=0.05)
    assert all(abs(unit["place"]["clock_offset"]) < 0.01 for unit in told["units"])


def test_an_offset_of_clocks_that_one_unit_alone_tells_is_said_to_be_so(recorded, capsys, read_as):
    read_as(units={"hand_left": read_as.whole.units["hand_left"]}, complete=False)
    assert calibrate("--recording", "units.mcap", "--joints", recorded / "joints.csv") == 0
    said = capsys.readouterr().out
    assert "Only hand_left shows this: no other unit agrees with it" in said
    assert "units.mcap is incomplete or damaged: the readable part is used." in said


def test_a_skin_that_is_wrong_about_a_link_keeps_that_unit_as_it_was(panda_model, skin, recorded, tmp_path, capsys):
    link6 = replace(skin.units[1], link="panda_link6", T_link_sensor=skin.units[1].T_link_sensor)
    silent = replace(skin.units[0], id="lost")
    believed = Skin([silent, link6, skin.units[2]], panda_model)
    old, out = tmp_path / "old.toml", tmp_path / "new.toml"
    save_skin(believed, old)
    assert calibrate("--recording", recorded / "units.mcap", "--skin", old, "--out", out) == 1
    said = capsys.readouterr().out
    assert f"{old} does not name forearm_left: their links are found." in said
    assert "hand_left is refused: It is said to sit on panda_link6" in said
    assert "lost is refused: It has 0 samples in 0 s" in said
    assert "Kept as before, without calibration: lost, hand_left." in said
    made = load_skin(out, panda_model)
    assert made.ids == ("lost", "hand_left", "hand_front", "forearm_left")
    np.testing.assert_allclose(made.T_link_sensor[:2], believed.T_link_sensor[:2], atol=1e-9)
    assert_same_places(Skin(made.units[2:], panda_model), skin)


def test_a_skin_file_is_replaced_only_if_that_is_said(panda_model, skin, recorded, tmp_path, capsys):
    place = tmp_path / "skin.toml"
    save_skin(skin, place)
    before = place.read_bytes()
    assert calibrate("--recording", recorded / "units.mcap", "--skin", place, "--out", place) == 2
    assert place.read_bytes() == before
    assert calibrate("--recording", recorded / "units.mcap", "--skin", place, "--out", place, "--replace") == 0
    assert load_skin(place, panda_model).arrays.position_sigma.all()


@pytest.mark.parametrize(
    ("words", "changes", "said"),
    [((), {"units": {}}, "units.mcap holds no IMU data"), (("--topic", "/joint_states"), {}, "--topic needs --joints")],
)
def test_what_is_missing_is_said(recorded, capsys, read_as, words, changes, said):
    read_as(**changes)
    assert calibrate("--recording", recorded / "units.mcap", *words) == 2
    assert said in capsys.readouterr().err


def test_a_recording_without_joint_states_is_refused(recorded, tmp_path, capsys, read_as):
    read_as()
    place = tmp_path / "units.mcap"
    with SkinRecording(place) as recording:
        recording.add(read_as.whole.units["hand_left"].samples[:9], ["a", "b", "c"])
    assert calibrate("--recording", place) == 2
    assert "units.mcap has no joint states: give the file that has them with --joints" in capsys.readouterr().err


def test_nothing_is_written_where_no_unit_is_good(recorded, tmp_path, capsys, read_as):
    read_as(flipped=True)
    assert calibrate("--recording", recorded / "units.mcap", "--out", tmp_path / "skin.toml") == 1
    assert f"{tmp_path / 'skin.toml'} is not written." in capsys.readouterr().out
    assert not (tmp_path / "skin.toml").exists()
