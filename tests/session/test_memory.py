"""What is remembered of a robot from one run to the next: its free motion, and bounds by physics on it."""

import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pretouch.contact.residual_model import RESTING, residual_init
from pretouch.errors import ParameterError, RobotModelError
from pretouch.params import SequentialParams
from pretouch.profiles import PROFILES
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.recording.writer import Recording
from pretouch.sensing.skin import paper_skin as skin_of_arm
from pretouch.session.memory import FreeMotion, ModelFile, check_learnt, load_learnt, model_file_of, save_learnt
from tests.following_arm import Arm

PROFILE = PROFILES["pretouch"]
OFFSET = np.array([0.6, -0.8, 0.5, 0.7, -0.3, 0.2, 0.3])
DAY_S = 86_400.0


@pytest.fixture
def file(tmp_path):
    return model_file_of("panda at 172.16.0.2, hand 0.73 kg", tmp_path / "pretouch")


def begun(file, arm, now=1e9):
    return FreeMotion(file, arm.controller, now=lambda: now)


def turned(arm, free, steps, recording=None, drift=0.0):
    """Let an arm follow its path, whose torques are off by OFFSET and a drift [Nm], from what is known of it."""
    arm.state = arm.controller.init(arm.robot(), free.begin)
    residuals, arm.evidence = [], []
    for _ in range(steps):
        cycle = arm.turn(change=lambda robot: replace(robot, tau_ext=robot.tau_ext + OFFSET + drift))
        for one in (free, recording) if recording else (free,):
            one.record(cycle)
        residuals.append(np.linalg.norm(cycle.step.residual))
        arm.evidence.append(cycle.step.evidence)
    return np.array(residuals)


def learnt(file, arm, steps=200, now=1e9):
    """Begin, let an arm follow its path, and keep what is learnt; return what is said of that."""
    free = begun(file, arm, now)
    turned(arm, free, steps)
    return free.save()


@pytest.fixture
def arm(panda_model, paper_skin):
    return Arm(panda_model, paper_skin, PROFILE)


@pytest.fixture
def another(panda_model, paper_skin):
    return Arm(panda_model, paper_skin, PROFILE)


def test_a_second_run_begins_with_what_the_first_has_learnt(file, arm, another):
    first = begun(file, arm)
    assert first.begin is None
    assert "This robot's free motion is not known yet" in first.sentence
    residuals = turned(arm, first, 400)
    (said,) = first.save()
    assert str(file.path) in said
    second = begun(file, another, now=1e9 + DAY_S)
    assert "this robot is known (3 s, saved 2001-09-09 01:46 UTC" in second.sentence
    assert_array_equal(np.delete(second.begin.weights, RESTING, 1), np.delete(arm.state.learnt.weights, RESTING, 1))
    again = turned(another, second, 100)
    assert residuals[0] > 1.0
    assert again[:50].max() < 0.3 * residuals[:50].max()


def test_a_recording_of_a_run_that_began_with_something_is_recomputed_bit_for_bit(tmp_path, file, arm, another):
    learnt(file, arm)
    with Recording(tmp_path / "run.mcap", another.controller) as recording:
        turned(another, begun(file, another), 50, recording)
    recorded = open_recording(tmp_path / "run.mcap")
    verdict = verify(recorded)
    assert verdict.agrees
    assert verdict.exact
    assert verdict.checked == 50
    begin = another.controller.with_places(recorded[0].snapshot.memory)
    assert np.abs(begin.get("test.model.weights")).max() > 0.1


def test_the_doubt_of_offset_and_friction_grows_in_a_pause_and_that_of_masses_does_not(file, arm):
    learnt(file, arm, 400)
    at_once, later = (begun(file, arm, now=1e9 + pause).begin.covariance for pause in (0.0, DAY_S))
    prior = PROFILE.detect
    assert_array_equal(at_once, arm.state.learnt.covariance)
    grown = (later - at_once)[:, range(13), range(13)]
    assert np.all(grown[:, 0] > 0.4 * (0.25 * prior.offset_prior_nm) ** 2)
    assert np.all(grown[:, 5:12] == 0.0)
    assert np.all(later[:, 0, 0] < prior.offset_prior_nm**2)
    np.testing.assert_allclose(later[:, 12, 12], prior.payload_prior_kg**2)
    assert np.linalg.eigvalsh(later).min() > 0.0
    backwards = begun(file, arm, now=1e9 - DAY_S).begin.covariance  # the machine's time was set back
    np.testing.assert_allclose(backwards, later)


@pytest.mark.parametrize(("pause", "felt"), [(0.0, True), (DAY_S, False)])
def test_an_arm_that_drifted_in_a_long_pause_feels_no_contact_that_is_none(file, arm, another, pause, felt):
    learnt(file, arm, 3000)
    turned(another, begun(file, another, now=1e9 + pause), 60, drift=0.4)
    assert (max(another.evidence) >= PROFILE.detect.suspect) is felt


def test_a_run_that_learns_nothing_leaves_the_file_as_it_is(file, arm, another):
    assert learnt(file, arm, 0) == learnt(file, arm, 5) == ()
    assert not file.path.exists()
    learnt(file, arm)
    before = file.path.read_bytes()
    assert learnt(file, another, 5, now=2e9) == ()
    assert file.path.read_bytes() == before


def test_it_adds_up_over_runs(file, arm, another):
    learnt(file, arm)
    learnt(file, another, now=1e9 + DAY_S)
    third = begun(file, another, now=1e9 + 2 * DAY_S)
    assert third.begin.seen.sum() > 1.5 * arm.state.learnt.seen.sum()
    assert "saved 2001-09-10 01:46 UTC" in third.sentence


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda text: text[: len(text) // 2], "holds no free motion"),
        (lambda text: "", "missing required field `format`"),
        (lambda text: text.replace('arm = "panda"', 'arm = "fr3"'), "arm = 'fr3'"),
        (lambda text: text.replace("format = 2", "format = 3"), "format = 3"),
        (lambda text: text.replace("joint1", "joint9", 1), "has joints = "),
        (lambda text: text.replace("\nweights = ", "\nothers = "), "weights is not of the shape"),
        (lambda text: text.replace("172.16.0.2", "172.16.0.3"), "belongs to panda at 172.16.0.3"),
        (lambda text: text.replace("saved = 1000000000.0", "saved = nan"), "the impossible time nan s"),
        (lambda text: text.replace("saved = 1000000000.0", "saved = 1e300"), "the impossible time 1e+300 s"),
    ],
)
def test_a_file_that_cannot_be_used_is_named_and_put_aside_once_something_is_learnt(file, arm, spoil, said):
    learnt(file, arm)
    good = file.path.read_text()
    spoilt = spoil(good)
    assert spoilt != good
    file.path.write_text(spoilt)
    free = begun(file, arm)
    assert free.begin is None
    assert said in " ".join(free.sentence.split())
    assert str(file.path) in free.sentence
    assert file.path.read_text() == spoilt
    turned(arm, free, 200)
    assert "saved" in free.save()[0]
    assert file.path.with_name(file.path.name + ".unusable").read_text() == spoilt
    assert begun(file, arm).begin is not None


def test_a_named_file_that_cannot_be_used_is_refused_and_never_written_over(tmp_path, arm):
    (tmp_path / "skin.toml").write_text("[[unit]]\n")
    with pytest.raises(RobotModelError, match=r"skin\.toml cannot be used as --learnt"):
        begun(ModelFile("panda at here", tmp_path / "skin.toml", True), arm)
    assert (tmp_path / "skin.toml").read_text() == "[[unit]]\n"


def test_a_named_file_may_be_of_another_robot_of_the_kind_but_not_of_another_kind(file, arm, fr3_model):
    learnt(file, arm)
    named = ModelFile("panda at 172.16.0.9", file.path, True)
    found = begun(named, arm)
    assert found.begin is not None
    assert "of panda at 172.16.0.2" in found.sentence
    other = Arm(fr3_model, skin_of_arm(fr3_model), PROFILE)
    with pytest.raises(RobotModelError, match="arm = 'panda'"):
        begun(named, other)


def test_writing_that_fails_is_a_sentence_and_leaves_the_old_file(file, arm, another, monkeypatch):
    learnt(file, arm)
    before = file.path.read_bytes()

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    (said,) = learnt(file, another, now=2e9)
    assert "No space left on device" in said
    assert "The previous file is unchanged" in said
    assert file.path.read_bytes() == before
    assert [file.name for file in file.path.parent.iterdir()] == [file.path.name]


KILLED = """
import os, signal, sys
from pathlib import Path
os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
from pretouch.atomic_write import atomic_write
atomic_write(Path(sys.argv[1]), "half of it")
"""


def test_a_process_that_is_killed_while_it_writes_leaves_the_old_file(tmp_path):
    path = tmp_path / "kept.toml"
    path.write_text("precious")
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_text() == "precious"


def test_robots_have_files_of_their_own(tmp_path):
    names = {model_file_of(f"{kind} at {where}, hand 0.7 kg", tmp_path).path for kind in "ab" for where in ("x", "y")}
    assert len(names) == 4
    assert model_file_of("../../etc/passwd: a\0b", tmp_path).path.parent == tmp_path / "free-motion"


def test_the_paper_s_detector_learns_nothing_to_keep(file, panda_model, paper_skin):
    with pytest.raises(ParameterError, match="The profile paper learns no free motion"):
        begun(file, Arm(panda_model, paper_skin))


FRESH = residual_init(7, SequentialParams())


def changed(name, at, value):
    array = getattr(FRESH, name).copy()
    array[at] = value
    return FRESH._replace(**{name: array})


@pytest.mark.parametrize(
    ("name", "at", "possible", "impossible", "words"),
    [
        ("weights", (0, 0), -87.0, -87.1, "a weight of 87.1, beyond the 87"),  # the Panda's first joint gives 87 Nm
        ("weights", (6, 3), 12.0, 1e6, r"a weight of 1e\+06, beyond the 12"),
        ("weights", (0, 0), 0.0, np.nan, "a weight of nan"),
        ("weights", (2, 8), -1.0, -1.01, "a weight of 1.01, beyond the 1 "),
        ("weights", (0, 12), 17.0, 18.0, "a weight of 18, beyond the 17.4"),  # kg of the arm
        ("covariance", (6, 0, 0), 143.0, 1e6, "a variance of"),
        ("spread", (1, 1, 6), 143.0, 145.0, "a spread of 145, beyond the 144"),
        ("spread", (0, 0, 3), 9999.0, 1e6, "a spread of"),
    ],
)
def test_what_an_arm_can_have_learnt_is_bounded(panda_model, name, at, possible, impossible, words):
    check_learnt(FRESH, panda_model)
    check_learnt(changed(name, at, possible), panda_model)
    with pytest.raises(ParameterError, match=words):
        check_learnt(changed(name, at, impossible), panda_model)


def test_what_is_saved_comes_back(panda_model, tmp_path):
    model = FRESH._replace(weights=FRESH.weights + 0.5, queue=FRESH.queue + 1.0, waiting=np.full(1, 3))
    model = model._replace(turning=FRESH.turning + 0.1, scatter=2.0 * FRESH.scatter, level=FRESH.level + 1.0)
    save_learnt(tmp_path / "a.toml", panda_model, model, "panda at home", 2.0)
    back, *about = load_learnt(tmp_path / "a.toml", panda_model, SequentialParams())
    assert np.all(back.weights == 0.5)
    for name in ("turning", "scatter", "level"):
        assert_array_equal(getattr(back, name), getattr(model, name))
    assert back.waiting[0] == 0
    assert not back.queue.any()
    assert about == ["panda at home", 2.0]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("covariance", lambda a: 0.0 * a),
        ("covariance", lambda a: a + np.triu(np.ones(13), 1)),
        ("covariance", lambda a: a + np.where(np.eye(13)[::-1] == 1.0, np.inf, 0.0)),
        ("spread", lambda a: -a),
        ("seen", lambda a: -a - 1.0),
        ("turning", lambda a: a - 1.0),
        ("scatter", lambda a: 0.0 * a),
        ("level", lambda a: a * np.nan),
    ],
)
def test_numbers_that_no_arm_can_have_are_refused(panda_model, name, change):
    with pytest.raises(ParameterError, match="anew"):
        check_learnt(FRESH._replace(**{name: change(getattr(FRESH, name))}), panda_model)
