"""The seconds before a latched HOLD, kept without a recording of the whole run."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.recording.writer import LastSeconds, Recording
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.types import Mode, SeenPoints, TouchReadings
from tests.following_arm import SHORT, controller_of
from tests.fuzz.invariants import same
from tests.recording.runs import Run


def broken(inputs):
    return replace(inputs, robot=replace(inputs.robot, q=np.full(7, np.nan)), resume=False)


def going_on(inputs):
    return replace(inputs, resume=False)


def broken_at(cycle):
    return lambda i, inputs: broken(inputs) if i == cycle else going_on(inputs)


def held(controller, folder, cycles, change, **more):
    """A run whose inputs are changed, by the cycle's number, and what is kept of it."""
    run = Run(controller)
    with LastSeconds(controller, folder, **more) as kept:
        for i in range(cycles):
            kept.record(run.turn(lambda inputs, i=i: change(i, inputs)))
    return run, kept


def test_a_latched_hold_leaves_its_last_seconds(controller, tmp_path):
    run, kept = held(controller, tmp_path / "holds", 410, broken_at(400), seconds=0.5)
    assert kept.written == [tmp_path / "holds" / "hold-1.mcap"]
    assert kept.trouble == ""
    recorded = open_recording(kept.written[0])
    assert recorded.complete
    last = recorded[len(recorded) - 1]
    assert same(last.step, run.cycles[400].step)
    assert last.step.mode is Mode.HOLD
    assert recorded.stamps()[[0, -1]] == pytest.approx([3.0, 4.0], abs=0.015)
    verdict = verify(recorded)
    assert verdict.agrees, verdict.sentence
    assert verdict.checked == len(recorded) >= 100


def test_what_is_felt_and_seen_from_outside_is_kept_too(panda_model, paper_skin, tmp_path):
    feeling = Skin([replace(unit, touch=TouchPatch()) for unit in paper_skin.units], panda_model)
    controller = controller_of(panda_model, feeling, profile("pretouch"))
    source = SeenPoints(0.0, np.zeros(1), np.array([[0.6, 0.2, 0.5]]), np.array([0.01]))

    def given(i, inputs):
        nonlocal source
        if i % 3 == 0:
            source = SeenPoints(inputs.stamp, np.full(1, inputs.stamp), source.point.copy(), source.sigma)
        touch = TouchReadings(np.full(7, inputs.stamp), np.arange(7) == i % 7, np.full(7, 2.0), np.zeros(7, np.int64))
        return broken_at(60)(i, replace(inputs, touch=touch, points=source))

    run, kept = held(controller, tmp_path / "holds", 65, given)
    recorded = open_recording(kept.written[0])
    for part in ("touch", "points"):
        assert same(getattr(recorded[50].inputs, part), getattr(run.cycles[50].inputs, part)), part
    assert verify(recorded).agrees


def test_a_hold_that_clears_by_itself_leaves_nothing(controller, tmp_path):
    def silent(i, inputs):
        return replace(inputs, readings=replace(inputs.readings, stamp=np.full(7, -1.0))) if i >= 20 else inputs

    run, kept = held(controller, tmp_path, 60, silent)
    assert run.cycles[-1].step.mode is Mode.HOLD
    assert kept.written == []
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_ends_with_the_very_step_that_latches_is_kept(controller, tmp_path):
    held(controller, tmp_path, 30, broken_at(29))
    assert len(open_recording(tmp_path / "hold-1.mcap")) == 30


def test_each_hold_has_a_file_but_no_more_than_a_few(controller, tmp_path):
    (tmp_path / "hold-1.mcap").write_text("dear")
    run, kept = Run(controller), LastSeconds(controller, tmp_path)
    for i in range(140):
        kept.record(run.turn(broken if i % 20 == 10 else lambda inputs: replace(inputs, resume=True)))
        for thread in kept._writing:
            thread.join()
    kept.close()
    assert [place.name for place in kept.written] == [f"hold-{k}.mcap" for k in range(2, 7)]
    assert (tmp_path / "hold-1.mcap").read_text() == "dear"


def test_what_is_recorded_is_handed_on(controller, tmp_path):
    run = Run(controller)
    other = controller_of(controller.model, controller.skin, replace(SHORT, name="other"))
    with Recording(tmp_path / "all.mcap", controller) as recording:
        kept = LastSeconds(controller, tmp_path, recording)
        for i in range(40):
            if i == 20:
                kept.change(other)
                run.state, run.controller = other.adopt(run.state, controller), other
            kept.record(run.turn(broken if i == 30 else going_on))
        kept.close()
    assert len(open_recording(tmp_path / "all.mcap")) == 40
    found = open_recording(tmp_path / "hold-1.mcap")
    assert [each.profile.name for each in found.runs] == ["other"]
    assert len(found) == 11
    assert verify(found).agrees


def test_inputs_that_fit_no_message_and_arrays_used_again_are_no_trouble(controller, tmp_path):
    run, kept = Run(controller), LastSeconds(controller, tmp_path)
    for i in range(40):
        cycle = run.turn(lambda inputs, i=i: replace(inputs, robot=None) if i == 20 else going_on(inputs))
        kept.record(cycle)
        if i != 20:
            cycle.inputs.robot.q[:] = cycle.inputs.readings.distance[:] = 9.0
    kept.close()
    found = open_recording(tmp_path / "hold-1.mcap")
    assert found[20].inputs is None
    assert "robot=None" in found[20].unreadable
    assert verify(found).agrees


def test_a_folder_that_cannot_be_made_is_one_sentence_and_raises_nothing(controller, tmp_path):
    (tmp_path / "file").touch()
    _, kept = held(controller, tmp_path / "file" / "folder", 12, broken_at(10))
    assert kept.written == []
    assert "were not saved" in kept.trouble
