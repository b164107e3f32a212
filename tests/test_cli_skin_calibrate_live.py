"""`pretouch skin calibrate --robot`: a simulated arm moves in real time, and all is recorded."""

import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch import cli
from pretouch.cli.calibrate import live
from pretouch.cli.calibrate.session import Session
from pretouch.errors import HardwareError, RecordingError
from pretouch.recording.calibration_data import read_measured
from pretouch.recording.skin_recording import SkinRecording
from pretouch.sensing.skin import load_skin
from pretouch.signals import Terminated, ends_raise, exit_code, noted_in_motion
from pretouch.types import RobotState
from tests.calibrated_arm import swinging

FILES = ("--keys", "keys.toml", "--out", "skin.toml", "--units-port", "0", "--robot", "simulated", "--yes")


def started(folder, *words):
    return subprocess.Popen(
        [sys.executable, "-m", "pretouch.cli", "skin", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, cwd=folder,
    )  # fmt: skip


def assert_found_to_a_millimetre(found, true):
    for unit in found.units:
        there = true.units[true.ids.index(unit.id)]
        T, wanted = unit.T_link_sensor, there.T_link_sensor
        assert unit.link == there.link
        assert np.linalg.norm(T[:3, 3] - wanted[:3, 3]) < 0.001
        # each board of the simulation is glued on askew by up to half a degree about each axis
        assert np.rad2deg(Rotation.from_matrix(T[:3, :3].T @ wanted[:3, :3]).magnitude()) < 1.0


class Arm:
    """Does exactly what it is told, as fast as it is asked."""

    def __init__(self, q):
        self.now, self.q, self.qd = 100.0, q.copy(), np.zeros(len(q))

    def begin(self):
        pass

    def tick(self):
        self.now += 0.01
        self.q = self.q + 0.01 * self.qd
        return self.now

    def read(self):
        return RobotState(self.now, self.q, self.qd, self.q, self.qd, np.zeros(7), None)

    def command(self, qd):
        self.qd = qd

    def monotonic(self, instant):
        return instant + 1000.0


class Source:
    """Hears nothing of one unit of two."""

    alive, address = True, ("127.0.0.1", 5)

    def take_samples(self):
        return []

    def traffic(self):
        return SimpleNamespace(units=[SimpleNamespace(id="a", state="live"), SimpleNamespace(id="b", state="silent")])


@pytest.fixture
def session(panda_model):
    return Session(Arm(panda_model.description.q_ready), panda_model, Source(), ("a", "b"))


def test_units_that_are_not_heard_are_named_before_the_arm_moves(session):
    with pytest.raises(HardwareError, match=r"^No data from b at 127\.0\.0\.1:5: check with `pretouch skin monitor`"):
        session.wait_for_units()


def test_joint_states_are_recorded_by_the_clock_of_the_units(session, panda_model, tmp_path, monkeypatch):
    plan, told = swinging(panda_model, 3.0), []
    with SkinRecording(tmp_path / "x.mcap") as recording:
        kept = []
        monkeypatch.setattr(recording, "joints", lambda stamp, q, qd, names: kept.append((stamp[0], q[0], names)))
        session.record(recording)
        assert session.follow(plan, told.append) is None
    stamp = np.array([one[0] for one in kept])
    assert stamp[0] == pytest.approx(1100.0, abs=0.05)
    assert np.diff(stamp) == pytest.approx(0.01)
    assert kept[0][2] == panda_model.joints
    assert told[-1] == pytest.approx(3.0, abs=0.05)


def test_a_receiver_that_ends_stops_the_arm(session, panda_model):
    session._source.alive = False
    stopped = session.follow(swinging(panda_model, 3.0), lambda since: None)
    assert "The receiver of the units has ended" in stopped
    np.testing.assert_array_equal(session._rig.qd, 0.0)


def test_a_disk_that_is_full_stops_the_arm(session, panda_model):
    session.record(SimpleNamespace(joints=lambda *_: None, sample=None, imu=None, trouble="The disk is full."))
    assert "The disk is full." in session.follow(swinging(panda_model, 3.0), lambda since: None)


def test_ctrl_c_comes_once_the_arm_is_at_rest(session, panda_model):
    def interrupt(since):
        if 1.0 < since < 1.05:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        session.follow(swinging(panda_model, 3.0), interrupt)
    np.testing.assert_array_equal(session._rig.qd, 0.0)
    assert session._rig.now < 102.0


def test_signals_that_are_ignored_stay_so():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with noted_in_motion() as came:
            signal.raise_signal(signal.SIGHUP)
        assert came == []
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_the_signal_that_came_first_ends_the_command_whatever_comes_while_others_are_heard_again(monkeypatch):
    really = signal.signal

    def interrupted(number, handler):
        before = really(number, handler)
        if number == signal.SIGINT and came:
            monkeypatch.undo()
            signal.raise_signal(signal.SIGINT)
        return before

    with ends_raise(), suppress(Terminated, KeyboardInterrupt), noted_in_motion() as came:
        monkeypatch.setattr(signal, "signal", interrupted)
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
    assert exit_code() == 128 + signal.SIGTERM


@pytest.fixture
def at_once(monkeypatch):
    """The command without an arm: it stands, and makes its motion at once."""

    @contextmanager
    def session(*_):
        yield SimpleNamespace(wait_for_units=lambda: None)

    monkeypatch.setattr(live, "_session", session)
    monkeypatch.setattr(live, "_ways", lambda *_: [])
    monkeypatch.setattr(live, "_recorded", lambda *_: print("It moves."))


@pytest.mark.parametrize(("error", "code"), [(RecordingError("The disk is bad."), 2), (KeyboardInterrupt(), 130)])
def test_how_to_calibrate_from_the_recording_is_said_before_the_motion_and_after_a_failure(
    at_once, tmp_path, monkeypatch, capsys, error, code
):
    def fails(*_):
        raise error

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(live, "calibrate_recording", fails)
    (tmp_path / "skin.toml").touch()
    taken = "skin-calibration-1.mcap"
    assert cli.main(["skin", "calibrate", *FILES, "--json", taken, "--skin", "skin.toml", "--replace"]) == code
    command = (
        "pretouch skin calibrate --recording skin-calibration-2.mcap --arm panda --out skin.toml --skin skin.toml"
        f" --json {taken} --replace\n"
    )
    before, after = capsys.readouterr().out.split("It moves.\n")
    assert before.endswith(f"All measurements are recorded in skin-calibration-2.mcap. To calibrate from it: {command}")
    assert after.endswith(f"The measurements are in skin-calibration-2.mcap. To calibrate from it: {command}")


@pytest.mark.slow
def test_the_units_of_an_arm_that_moves_here_and_now_are_found(panda_model, paper_skin, tmp_path):
    process = started(tmp_path, "calibrate", *FILES, "--duration", "35")
    out, err = process.communicate(timeout=200)
    assert process.returncode == 0, out + err
    assert "Skin file: skin.toml has 7 units where they were found." in out
    assert_found_to_a_millimetre(load_skin(tmp_path / "skin.toml", panda_model), paper_skin)
    measured = read_measured(tmp_path / "skin-calibration-1.mcap")
    assert measured.complete
    assert np.ptp(measured.joints.stamp) == pytest.approx(35.5, abs=0.5)
    assert sorted(measured.units) == sorted(paper_skin.ids)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_motion_that_is_interrupted_leaves_its_recording_and_says_how_to_go_on(tmp_path, number, code):
    process = started(tmp_path, "calibrate", *FILES)
    assert process.stdout
    for line in process.stdout:
        if line.startswith("Waiting"):
            break
    time.sleep(8.0)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == code
    assert "Traceback" not in err
    assert re.search(r"The arm was stopped\. skin-calibration-1\.mcap holds \d+ samples, in .* MB\.", out)
    assert "pretouch skin calibrate --recording skin-calibration-1.mcap --arm panda --out skin.toml" in out
    assert not (tmp_path / "skin.toml").exists()
    assert read_measured(tmp_path / "skin-calibration-1.mcap").joints is not None
