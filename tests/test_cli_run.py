"""`pretouch run`: what is refused, and a rehearsal from the checks to the report."""

import io
import os
import signal
import threading
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pretouch import cli, plugins
from pretouch.arms import OpenedArm
from pretouch.arms.simulated import Simulated
from pretouch.arms.simulated.arm import ThreadedArm
from pretouch.cli.options import ProcessOptions, RobotOptions, SkinOptions, TaskOptions
from pretouch.cli.run.command import Run
from pretouch.cli.run.setup import run_setup
from pretouch.recording.disk import Disk
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.session.memory import Identity
from pretouch.session.push import GuidedPush
from pretouch.types import Mode
from tests.other_arm import copied_panda

CONFIRM = GuidedPush.confirm
BLIND = ("run", "--no-skin", "--profile", "blind", "--path", "hold")


@pytest.fixture(autouse=True)
def _state_of_its_own(tmp_path, monkeypatch):
    """A folder of its own, in which the force sign counts as confirmed: pushes take seconds."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr("pretouch.session.may_move.WATCH_S", 0.5)
    monkeypatch.setattr(GuidedPush, "confirm", lambda *_: None)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def _pushes(monkeypatch):
    """The force sign has to be confirmed."""
    monkeypatch.setattr(GuidedPush, "confirm", CONFIRM)


def at_begin(monkeypatch, seconds, then):
    """Have something done a while after the arm was let move."""
    begin = ThreadedArm.begin

    def begun(arm):
        begin(arm)
        threading.Timer(seconds, then, (arm,)).start()

    monkeypatch.setattr(ThreadedArm, "begin", begun)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("frank",), "No arm to move is called 'frank': perhaps franka."),
        (("franka", "--ip", "192.0.2.1"), "The arm brings no sensor units: give the file of their keys with --keys"),
        (("--no-skin",), "choose --profile blind"),
        (("--no-skin", "--skin", "a.toml"), "--no-skin does not go with --skin"),
        (("--skin", "missing.toml"), "missing.toml cannot be read"),
        (("--seconds", "-1"), "--seconds is -1"),
        (("--seconds", "inf"), "--seconds is inf"),
        (("--floor", "nan"), "--floor is nan"),
        (("--seed", "-1"), "--seed is -1"),
        (("--units-host", ""), "--units-host is empty"),
        (("--path", "circle", "--radius", "3"), "cannot reach"),
        (("--no-learnt", "--learnt", "a.toml"), "--no-learnt does not go with"),
        (("--arm", "ur5"), "There is no arm 'ur5'"),
        ((*BLIND[1:], "--learnt", "new.toml"), "does not learn free motion"),
        (("--record", "/dev/null"), "/dev/null exists already: give another file to --record."),
    ],
)
def test_what_does_not_fit_together_is_refused_in_a_sentence(words, said, capsys):
    assert cli.main(["run", *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("words", [(), ("simulated",), ("--seed", "0")])
def test_without_the_name_of_an_arm_a_simulated_one_is_rehearsed(words, monkeypatch):
    commands = []
    monkeypatch.setattr(Run, "run", lambda command: commands.append(command))
    assert cli.main(["run", *words]) == 0
    assert commands == [Run(TaskOptions(), Simulated(), RobotOptions(), SkinOptions(), ProcessOptions())]


def test_an_arm_of_a_distribution_that_is_not_installed_is_a_sentence(monkeypatch, capsys):
    monkeypatch.setattr(plugins, "names", lambda group: ())
    assert cli.main(["run", "ros2", "--sign", "on-robot"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("The arm 'ros2' is in the distribution pretouch-ros2, which is not installed: run ")
    assert said.count("\n") == 1


def test_a_franka_arm_is_a_panda_or_an_fr3(tmp_path, capsys):
    folder = str(copied_panda(tmp_path))
    assert cli.main(["run", "franka", "--ip", "192.0.2.1", "--arm", folder, *BLIND[1:]]) == 2
    assert f"--arm {folder} is no arm of `pretouch run franka`" in " ".join(capsys.readouterr().err.split())


def test_an_arm_that_does_not_come_with_the_package_has_its_path_placed_and_that_is_said(tmp_path):
    folder = str(copied_panda(tmp_path))
    made = run_setup(Simulated(), RobotOptions(arm=folder), SkinOptions(), TaskOptions())
    assert made.assumed[0].startswith("The paper's paths for panda:")
    at = made.model.kinematics(made.simulated_start()).position[made.model.ee]
    assert np.linalg.norm(at - made.placement.point(0.5, 0.0, 0.25)) == pytest.approx(0.25 * made.placement.scale)
    task = TaskOptions(center=(0.45, 0.0, 0.3), radius=0.1)
    given = run_setup(Simulated(), RobotOptions(arm=folder), SkinOptions(), task)
    assert given.floor == -0.2
    assert len(given.assumed) == 1  # of the simulated arm, not of a path that is given
    assert run_setup(Simulated(), RobotOptions(), SkinOptions(), TaskOptions()).assumed == ()


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.usefixtures("_pushes")
def test_a_rehearsal_checks_confirms_announces_goes_to_its_path_moves_and_reports(tmp_path, capsys):
    words = "--no-skin", "--profile", "blind", "--path", "line", "--approach", "--seconds", "0.3", "--yes"
    assert cli.main(["run", *words, "--record", "a.mcap"]) == 0
    said = capsys.readouterr().out
    order = [
        "All checks passed", "A simulated person pushes the hand", "towards +y", "towards +x", "towards +z",
        "The force sign is confirmed", "First the arm moves slowly", "To stop it", "HOLD", "The arm is at rest.",
        "a.mcap holds",
    ]  # fmt: skip
    places = [said.find(part) for part in order]
    assert -1 not in places
    assert places == sorted(places)
    steps = [kept.step for kept in open_recording(tmp_path / "a.mcap")]
    assert np.linalg.norm(steps[0].ee_position - steps[0].path_position) < 0.02
    assert steps[-1].stamp - steps[0].stamp >= 0.28  # a busy machine leaves out some cycles
    assert not (tmp_path / "state").exists()


def test_a_damaged_note_of_confirmed_robots_is_found_before_the_checks(tmp_path, capsys, monkeypatch):
    place = tmp_path / "state" / "pretouch" / "force-sign.json"
    place.parent.mkdir(parents=True)
    place.write_text("[")
    opened = partial(OpenedArm, identity=Identity("test", "here", "nothing"))
    monkeypatch.setattr("pretouch.arms.simulated.OpenedArm", opened)
    assert cli.main([*BLIND, "--seconds", "0.1", "--yes"]) == 2
    shown = capsys.readouterr()
    assert "is damaged: delete it" in shown.err
    assert "checks" not in shown.out


def test_a_recording_that_fails_in_the_middle_is_told_at_once_and_by_the_exit_code(capsys, monkeypatch):
    notes = iter([["It is old."], ["It is old.", "It was late."]])
    monkeypatch.setattr("pretouch.arms.simulated.OpenedArm", partial(OpenedArm, notes=lambda: next(notes)))
    full = property(lambda disk: "The disk is full.", lambda disk, text: None)
    at_begin(monkeypatch, 0.2, lambda _: monkeypatch.setattr(Disk, "trouble", full, raising=False))
    assert cli.main([*BLIND, "--seconds", "1", "--yes", "--record", "a.mcap"]) == 1
    said = capsys.readouterr().out
    assert -1 < said.find("The disk is full.") < said.find("The arm is at rest.")
    assert [said.count(part) for part in ("The disk is full.", "It is old.", "It was late.")] == [2, 1, 1]
    assert "ended early" not in said


LEARNING = (
    "run", "--no-skin", "--path", "hold", "--yes", "--profile",
    "pretouch:perception=none:detect.learn=always",
)  # fmt: skip


@pytest.mark.slow
def test_a_second_run_begins_with_what_the_first_learnt_and_can_be_recomputed(tmp_path, capsys):
    place = tmp_path / "state" / "pretouch" / "free-motion" / "simulated-panda-seed-0.toml"
    known = "Free motion of this robot is known ("
    for name, told in (("a", "This robot's free motion is not known yet"), ("b", known)):
        assert cli.main([*LEARNING, "--seconds", "2", "--record", f"{name}.mcap"]) == 0
        said = capsys.readouterr().out
        assert told in said
        assert str(place) in said
        assert verify(open_recording(tmp_path / f"{name}.mcap")).agrees
    runs = [open_recording(tmp_path / f"{name}.mcap") for name in "ab"]
    first, second = (run.runs[0].controller().whole_detector(run[0].snapshot).test.model for run in runs)
    assert not first.weights.any()
    assert second.seen.sum() > 50
    kept = place.read_text()
    assert cli.main([*LEARNING, "--seconds", "2", "--no-learnt"]) == 0
    assert place.read_text() == kept
    assert "ree motion" not in capsys.readouterr().out


@pytest.mark.slow
def test_what_was_learnt_is_kept_after_ctrl_c_in_the_file_that_was_named(tmp_path, capsys, monkeypatch):
    at_begin(monkeypatch, 3.0, lambda _: os.kill(os.getpid(), signal.SIGINT))
    assert cli.main([*LEARNING, "--learnt", "arms/mine.toml"]) == 130
    assert "Free motion saved" in capsys.readouterr().out
    assert (tmp_path / "arms" / "mine.toml").exists()
    assert not (tmp_path / "state").exists()


@pytest.mark.slow
def test_an_approach_that_is_broken_off_is_reported_and_no_refusal(tmp_path, capsys, monkeypatch):
    def fail(arm):
        arm._failure = "its power failed"

    at_begin(monkeypatch, 0.5, fail)
    words = "--no-skin", "--profile", "blind", "--path", "line", "--approach", "--yes", "--record", "a.mcap"
    assert cli.main(["run", *words]) == 1
    said = capsys.readouterr().out
    assert "The arm did not reach the start of its path." in said
    assert "its power failed" in said
    assert "a.mcap holds 0 control steps" in said
    assert not list((tmp_path / "runs").glob("**/*"))


def test_an_arm_that_is_moved_while_a_person_is_asked_is_not_let_go(capsys, monkeypatch):
    read, turned = ThreadedArm.read, []

    def asked(*_):
        turned.append(0.1)

    def moved(arm):
        state = read(arm)
        return replace(state, q=state.q + sum(turned))

    monkeypatch.setattr("pretouch.cli.run.command.require_yes", asked)
    monkeypatch.setattr(ThreadedArm, "read", moved)
    monkeypatch.setattr(ThreadedArm, "begin", pytest.fail)
    assert cli.main([*BLIND, "--seconds", "1"]) == 2
    assert "The arm moved after the checks" in capsys.readouterr().err


def test_ctrl_c_after_the_report_waits_until_all_is_closed(tmp_path, capsys, monkeypatch):
    close, closed = ThreadedArm.__exit__, []

    def interrupted(arm, *error):
        os.kill(os.getpid(), signal.SIGINT)
        close(arm, *error)
        closed.append(arm)

    monkeypatch.setattr(ThreadedArm, "__exit__", interrupted)
    assert cli.main([*BLIND, "--seconds", "0.1", "--yes", "--record", "deep/er/a.mcap"]) == 130
    assert closed
    assert "The arm is at rest." in capsys.readouterr().out
    assert len(open_recording(tmp_path / "deep" / "er" / "a.mcap"))
    assert cli.main([*BLIND, "--seconds", "-1"]) == 2


def test_without_a_terminal_nobody_lets_the_arm_move(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert cli.main([*BLIND, "--seconds", "1"]) == 2
    shown = capsys.readouterr()
    assert "no terminal to ask for" in shown.err
    assert "HOLD" not in shown.out


@pytest.mark.slow
@pytest.mark.usefixtures("_pushes")
def test_a_wrong_sign_is_refused_before_anything_moves(capsys, monkeypatch):
    read, began = ThreadedArm.read, []

    def opposite(arm):
        state = read(arm)
        return replace(state, tau_ext=-state.tau_ext, wrench=-state.wrench)

    monkeypatch.setattr(ThreadedArm, "read", opposite)
    monkeypatch.setattr(ThreadedArm, "begin", began.append)
    assert cli.main([*BLIND, "--seconds", "1", "--yes"]) == 2
    assert "force by the robot, not on it" in capsys.readouterr().err
    assert not began


@pytest.mark.usefixtures("_pushes")
def test_without_a_push_nothing_moves(capsys, monkeypatch):
    monkeypatch.setattr(ThreadedArm, "push", lambda *_: None)
    monkeypatch.setattr("pretouch.session.push.TIMEOUT_S", 0.5)
    assert cli.main([*BLIND, "--seconds", "1", "--yes"]) == 2
    assert "No clear push towards +y" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_in_the_middle_brings_the_arm_to_rest_and_files_are_whole(tmp_path, capsys, monkeypatch, number, code):
    at_begin(monkeypatch, 2.5, lambda _: os.kill(os.getpid(), number))
    assert cli.main(["run", "--no-skin", "--profile", "blind", "--yes", "--record", "a.mcap"]) == code
    said = capsys.readouterr().out
    assert "The arm is at rest." in said
    assert "a.mcap holds" in said
    recorded = open_recording(tmp_path / "a.mcap")
    assert recorded.complete
    assert recorded[len(recorded) - 1].step.mode is Mode.TRACK
    assert np.linalg.norm(recorded[len(recorded) - 1].step.ee_velocity) > 0.1


@pytest.mark.slow
@pytest.mark.alone
def test_a_unit_that_falls_silent_in_the_middle_is_named_and_the_arm_holds(tmp_path, capsys, monkeypatch):
    def silence(arm):
        # one alone: of several, the one named is that whose last reading happens to be the oldest
        arm._arm.fleet.units[0].silent = True

    at_begin(monkeypatch, 2.5, silence)
    words = "--yes", "--seconds", "4", "--record", "a.mcap"
    assert cli.main(["run", *words]) == 0
    assert "No usable reading from hand_left" in capsys.readouterr().out
    steps = [kept.step for kept in open_recording(tmp_path / "a.mcap")]
    assert any(step.mode is Mode.TRACK for step in steps)
    assert steps[-1].mode is Mode.HOLD
    assert not steps[-1].command.any()
