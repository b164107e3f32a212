"""`pretouch skin calibrate simulated`: an arm moves in real time, and all is recorded."""

import re
import signal
import time
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from pretouch import cli
from pretouch.arms import OpenedArm
from pretouch.arms.simulated import Simulated
from pretouch.calibration.motion.follow import plan_controller
from pretouch.calibration.motion.plan import Plan
from pretouch.cli.calibrate import live
from pretouch.errors import RecordingError, RobotError
from pretouch.imported_data.reading import read_joints
from pretouch.sensing.skin import load_skin
from pretouch.session.run import Ending, go
from pretouch.units.skin import NetworkSkin, Traffic
from pretouch.units.skin_recording import read_skin
from tests.calibrated_arm import assert_same_places
from tests.session.arms import AT_REST, FollowingArm
from tests.test_cli_skin import started

FILES = ("simulated", "--out", "skin.toml", "--yes")


class Units(NetworkSkin):
    """Hear nothing."""

    alive, address = True, ("127.0.0.1", 5)

    def __init__(self):
        pass

    def take_samples(self):
        return []

    def traffic(self):
        return Traffic((), {}, 0)


def ended(model, units=None, trouble="", joints=lambda *_: None):
    """Let an arm follow a plan while that is recorded; return how it ended, and where it was."""
    recording = SimpleNamespace(joints=joints, add=lambda *_: None, trouble=trouble)
    q, ending = model.description.q_ready, Ending()
    arm, plan = FollowingArm(q), Plan(np.array([0.0, 1.0]), np.array([q, q + 0.05]))
    measurements = live.Measurements(recording, units or Units(), (), model.joints)
    go(arm, plan_controller(model, q), plan, ending, measurements)
    assert not arm.commands[-1].any()
    return ending, arm


def test_joint_states_are_recorded_as_the_controller_has_them(panda_model):
    rows = []
    ending, arm = ended(panda_model, joints=lambda *row: rows.append(row))
    assert ending == AT_REST
    stamps, q = (np.concatenate(column) for column in list(zip(*rows, strict=True))[:2])
    assert np.all(np.diff(stamps) > 0.0)
    assert {row[3] for row in rows} == {panda_model.joints}
    assert q[0] == pytest.approx(panda_model.description.q_ready)
    assert q[-1] == pytest.approx(arm.q, abs=5e-3)


def test_a_receiver_that_ends_and_a_full_disk_stop_the_arm(panda_model):
    assert ended(panda_model, trouble="The disk is full.")[0].stopped == "The disk is full."
    dead = Units()
    dead.alive = False
    assert "The receiver of the units has ended" in ended(panda_model, dead)[0].stopped


def test_nothing_is_said_of_rest_where_the_arm_is_lost_between_two_motions(panda_model, capsys):
    q, measurements = panda_model.description.q_ready, SimpleNamespace(record=lambda _: None)
    arm, plan = FollowingArm(q), Plan(np.array([0.0, 0.2]), np.array([q, q + 0.002]))
    measurements.recording, arm.gone = SimpleNamespace(close=lambda: "It is recorded."), True
    with pytest.raises(RobotError, match="No state has come"):
        live._move(OpenedArm(arm), panda_model, [plan, plan], measurements)
    assert arm.begun == 1
    assert capsys.readouterr().out.splitlines() == [*["The arm moves for 0 s."] * 2, "It is recorded."]


@pytest.fixture
def at_once(monkeypatch, paper_skin):
    """The command without an arm: it stands, and makes its motion at once."""

    @contextmanager
    def opened(*_):
        arm = SimpleNamespace(unfit=lambda: (), report=lambda: "")
        yield OpenedArm(arm, skin=Units())

    monkeypatch.setattr(Simulated, "open", opened)
    monkeypatch.setattr(live, "skin_for", lambda *_, **__: paper_skin)
    monkeypatch.setattr(live.UnitWatch, "wait", lambda *_: None)
    monkeypatch.setattr(live, "_plans", lambda *_: [])


@pytest.mark.parametrize(
    ("error", "early", "code"),
    [(RecordingError("A bad disk."), False, 2), (KeyboardInterrupt(), False, 130), (None, True, 1), (None, False, 0)],
)
def test_how_to_calibrate_from_the_recording_is_said_before_the_motion_and_after_a_failure(
    at_once, tmp_path, monkeypatch, capsys, error, early, code
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(live, "_move", lambda *_: print("It moves.") or early)
    monkeypatch.setattr(live, "calibrate_recorded", Mock(side_effect=error, return_value=0))
    for there in ("skin.toml", "skin-calibration-1.mcap"):
        (tmp_path / there).touch()
    assert cli.main(["skin", "calibrate", *FILES, "--json", "numbers", "--skin", "skin.toml", "--replace"]) == code
    command = (
        "To calibrate from it: pretouch skin calibrate --recording skin-calibration-2.mcap --skin skin.toml"
        " --out skin.toml --json numbers --replace --arm panda\n"
    )
    before, after = capsys.readouterr().out.split("It moves.\n")
    assert before.endswith(f"All measurements are recorded in skin-calibration-2.mcap. {command}")
    assert after == (f"The measurements are in skin-calibration-2.mcap. {command}" if code else "")


@pytest.mark.alone
@pytest.mark.slow
def test_the_units_of_an_arm_that_moves_here_and_now_are_found(panda_model, paper_skin, tmp_path):
    process = started("calibrate", *FILES, "--poses", "2", folder=tmp_path)
    out, err = process.communicate(timeout=200)
    assert process.returncode == 0, out + err
    assert "Skin file: skin.toml has 7 units where they were found." in out
    # each board of the simulation is glued on askew by up to half a degree about each axis
    assert_same_places(load_skin(tmp_path / "skin.toml", panda_model), paper_skin, within_deg=1.0)
    measured = read_skin(tmp_path / "skin-calibration-1.mcap")
    assert measured.complete
    assert 25.0 < np.ptp(read_joints(tmp_path / "skin-calibration-1.mcap", panda_model)[0].stamp) < 40.0
    assert sorted(measured.units) == sorted(paper_skin.ids)


@pytest.mark.alone
@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_motion_that_is_interrupted_leaves_its_recording_and_says_how_to_go_on(panda_model, tmp_path, number, code):
    process = started("calibrate", *FILES, folder=tmp_path)
    assert process.stdout
    assert any(line.startswith("Waiting") for line in process.stdout)
    time.sleep(8.0)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == code
    assert "Traceback" not in err
    assert re.search(r"ended early: A signal came\.\nskin-calibration-1\.mcap holds \d+ samples, in .* MB\.", out)
    assert "pretouch skin calibrate --recording skin-calibration-1.mcap --out skin.toml" in out
    assert not (tmp_path / "skin.toml").exists()
    assert len(read_joints(tmp_path / "skin-calibration-1.mcap", panda_model)[0].stamp) > 10
