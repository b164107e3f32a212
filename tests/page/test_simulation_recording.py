"""A live session that is recorded."""

import numpy as np
import pytest
from tests.page.sessions import ARMED_S, poke, set_speed

from pretouch.errors import RecordingError
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES, profile
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.types import Mode


@pytest.fixture
def session(live):
    """A session on its way."""
    session = live(object="board -y")
    session.advance(ARMED_S)
    return session


def switched(session: LiveSimulation) -> list:
    """Steps in which a person changes all there is to change."""
    steps = session.advance(0.3)
    session.set_profile(PROFILES["blind"])
    steps += session.advance(0.3)
    session.set_profile(profile("paper:window.samples=40"))
    session.set_path("line")
    steps += session.advance(0.8)
    steps += poke(session)
    set_speed(session, 0.2)
    steps += session.advance(0.3)
    session.silence(frozenset({session.skin.ids[1]}))
    return steps + session.advance(0.7)


def test_each_step_is_kept_with_what_only_the_simulation_knows_and_is_recomputed_and_the_run_stays_as_it_is(
    session, panda_model, paper_skin, tmp_path
):
    other = LiveSimulation(session.settings, panda_model, paper_skin)
    other.advance(ARMED_S)
    place = tmp_path / "live.mcap"
    session.start_recording(place)
    steps = switched(session)
    closed = session.stop_recording()
    for mine, theirs in zip(steps, switched(other), strict=True):
        np.testing.assert_array_equal(mine.command, theirs.command)
    assert session.recording is None
    assert f"{len(steps)} control steps" in closed
    recorded = open_recording(place)
    assert len(recorded) == len(steps)
    assert [run.profile.perception is not None for run in recorded.runs] == [True, False, True, True]
    assert [run.profile.window.samples for run in recorded.runs] == [100, 100, 40, 40]
    assert [run.profile.task.speed_m_s for run in recorded.runs] == [0.3, 0.3, 0.3, 0.2]
    assert [run.path.length for run in recorded.runs][-1] == pytest.approx(2.0)
    for cycle, step in zip(recorded, steps, strict=True):
        assert cycle.step.stamp == step.stamp
        np.testing.assert_array_equal(cycle.step.command, step.command)
        assert cycle.truth.time == pytest.approx(step.stamp + 0.001 * np.arange(-9, 1))
    forces = np.vstack([cycle.truth.force for cycle in recorded])
    assert np.linalg.norm(forces, axis=1).max() > 10.0
    assert sum(len(cycle.truth.touches) for cycle in recorded) > 0
    hands = np.array([cycle.truth.hand for cycle in recorded])
    assert np.ptp(hands[:, 1]) > 0.05
    scene = recorded.runs[0].about["scene"]
    assert [box["name"] for box in scene["boxes"]] == ["object"]
    assert scene["hand_radius_m"] == 0.05
    verdict = verify(recorded)
    assert verdict.agrees, verdict.sentence
    assert verdict.exact
    assert (verdict.checked, verdict.skipped) == (len(steps), {})
    assert any(cycle.step.mode is Mode.REACT for cycle in recorded)


def test_a_reset_ends_the_recording_and_says_so(session, tmp_path):
    session.start_recording(tmp_path / "live.mcap")
    session.advance(0.2)
    session.reset()
    assert session.recording is None
    assert "holds 20 control steps" in session.notice
    assert len(open_recording(tmp_path / "live.mcap")) == 20
    assert session.stop_recording() == ""


def test_another_recording_ends_the_one_before(session, tmp_path):
    for name in ("a", "b"):
        session.start_recording(tmp_path / f"{name}.mcap")
        session.advance(0.1)
    session.stop_recording()
    assert [len(open_recording(tmp_path / f"{name}.mcap")) for name in ("a", "b")] == [10, 10]


def test_a_place_that_cannot_be_written_is_refused_and_the_session_goes_on(session, tmp_path):
    with pytest.raises(RecordingError):
        session.start_recording(tmp_path / "no" / "such" / "folder.mcap")
    assert session.recording is None
    assert session.advance(0.1)


def test_a_recording_in_trouble_ends_with_its_sentence_and_the_session_goes_on(session, tmp_path, monkeypatch):
    session.start_recording(tmp_path / "live.mcap")
    session.advance(0.1)
    monkeypatch.setattr(session.recording._disk, "trouble", "The disk is full.")
    assert len(session.advance(0.1)) == 10
    assert session.notice == "The disk is full."
    assert session.recording is None
    recorded = open_recording(tmp_path / "live.mcap")
    assert (len(recorded), recorded.complete) == (10, True)
