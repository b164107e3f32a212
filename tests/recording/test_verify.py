"""Recordings recomputed: bit for bit here, within a tolerance elsewhere, and the first difference found."""

from dataclasses import replace
from unittest.mock import Mock

import msgspec
import numpy as np
import pytest

from pretouch.contact.window import window_init
from pretouch.control.path import segment
from pretouch.loop import Cycle
from pretouch.recording import verify as verifying
from pretouch.recording import writer
from pretouch.recording.reader import open_recording
from pretouch.recording.ros import packed_data, packed_message
from pretouch.recording.verify import differing, verify
from pretouch.recording.writer import Recording
from pretouch.robot.model import RobotModel
from pretouch.types import Mode
from tests.following_arm import SHORT, controller_of
from tests.fuzz.machine import Course, Machine
from tests.fuzz.worlds import any_world
from tests.recording.runs import Run, changed, record, recorded_run, steps_changed


@pytest.fixture(scope="module")
def place(controller, tmp_path_factory):
    """A recorded run, which nobody writes to."""
    place = tmp_path_factory.mktemp("run") / "a.mcap"
    recorded_run(place, controller, 320)
    return place


def test_a_run_is_recomputed_bit_for_bit(place):
    done = []
    verdict = verify(open_recording(place), done.append)
    assert verdict.agrees
    assert verdict.exact
    assert (verdict.steps, verdict.checked, verdict.skipped, verdict.differing) == (320, 320, {}, 0)
    assert verdict.sentence == "All 320 steps were recomputed and are the same bit for bit."
    assert done == list(range(1, 321))


class RecordedCourse(Course):
    """A fuzzed course that is recorded instead of checked."""

    recording: Recording

    def step(self, inputs, deep):
        before = self.state
        step, self.state = self.controller.step(before, inputs)
        self.recording.record(Cycle(inputs, before, step, self.state))
        self._follow(step.command)
        return step


@pytest.mark.parametrize("seed", [0, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 3, 4, 5))])
def test_whatever_comes_in_is_recomputed_bit_for_bit(seed, tmp_path):
    machine = Machine(seed)
    course = RecordedCourse(machine, any_world(machine.rng, machine.models[seed % 2]))
    with Recording(tmp_path / "a.mcap", course.controller) as course.recording:
        course.run(250)
    recorded = open_recording(tmp_path / "a.mcap")
    verdict = verify(recorded)
    assert verdict.agrees, verdict.sentence
    assert verdict.checked == len(recorded) == 250


def test_inputs_that_could_not_be_kept_are_skipped_and_the_rest_is_recomputed(controller, tmp_path):
    place, gone = tmp_path / "a.mcap", (20, 21, 40)
    record(Run(controller), place, 60, lambda i, inputs: replace(inputs, robot=None) if i in gone else inputs)
    verdict = verify(open_recording(place))
    assert verdict.agrees, verdict.sentence
    assert verdict.checked == 57
    assert verdict.skipped == {"inputs that could not be kept": 3}
    assert "3 steps have inputs that could not be kept" in verdict.sentence


def test_a_change_of_profile_and_path_is_followed(controller, tmp_path, monkeypatch):
    run, models = Run(controller), Mock(wraps=RobotModel)
    monkeypatch.setattr(writer, "RobotModel", models)
    with Recording(tmp_path / "a.mcap", controller, {"command": "test"}) as recording:
        for i in range(90):
            if i in (30, 60):
                changed = replace(SHORT, name=f"p{i}", window=replace(SHORT.window, samples=i))
                path = segment((0.4, 0.0, 0.5), (0.4, i / 100, 0.4))
                other = controller_of(controller.model, controller.skin, changed, path)
                run.state, run.controller = other.adopt(run.state, run.controller), other
                recording.change(other)
            recording.record(run.turn())
    assert models.call_count == 1, "the arm stays"
    recorded = open_recording(tmp_path / "a.mcap")
    assert [kept.run for kept in recorded] == [0] * 30 + [1] * 30 + [2] * 30
    assert [(each.profile.name, each.sequence) for each in recorded.runs] == [(SHORT.name, 0), ("p30", 30), ("p60", 60)]
    assert recorded.runs[0].about == {"command": "test"}
    verdict = verify(recorded)
    assert verdict.agrees, verdict.sentence
    assert verdict.checked == 90


def test_a_bit_that_was_flipped_is_the_first_difference(place, tmp_path):
    def flip(step):
        qd = step.qp.qd.copy()
        qd[3] = np.nextafter(qd[3], 1.0)
        return replace(step, qp=replace(step.qp, qd=qd))

    def move(step):
        return replace(step, ee_position=step.ee_position + np.array([0.0, 0.25, 0.0]))

    made = open_recording(steps_changed(place, tmp_path / "b.mcap", {123: flip, 200: move}))
    verdict = verify(made)
    assert not verdict.agrees
    assert verdict.differing == 2
    assert (verdict.first.number, verdict.first.field) == (123, "qp.qd[3]")
    assert verdict.first.stamp == made[123].step.stamp
    assert np.nextafter(verdict.first.recomputed, 1.0) == verdict.first.recorded
    assert (verdict.largest, verdict.largest_field) == (pytest.approx(0.25), "ee_position[1]")
    assert "step 123 at 1.2" in verdict.sentence
    assert "qp.qd[3] was" in verdict.sentence


@pytest.mark.parametrize(
    ("change", "field", "recorded"),
    [
        (lambda s: replace(s, mode=Mode.REACT), "mode", "react"),
        (lambda s: replace(s, reason="Because."), "reason", "Because."),
        (lambda s: replace(s, path_phase=-s.path_phase), "path_phase", -0.0),
        (lambda s: replace(s, restricted=np.arange(9), approach_limit=np.ones(9)), "restricted", "shape (9,)"),
        (lambda s: replace(s, armed=not s.armed), "armed", False),
    ],
)
def test_a_difference_of_any_kind_is_named(place, tmp_path, change, field, recorded):
    changes = {2 if field == "path_phase" else 60: change}
    first = verify(open_recording(steps_changed(place, tmp_path / "b.mcap", changes))).first
    assert (first.field, first.recorded) == (field, recorded)


def snapshots(recorded) -> list[int]:
    return [i for i, kept in enumerate(recorded) if kept.snapshot is not None]


def second_snapshot_changed(place, other):
    """The same file, its second snapshot 1 ns later."""
    second = snapshots(open_recording(place))[1]

    def change(topic, number, data):
        if (topic, number) != ("/pretouch/state", second):
            return data
        table = msgspec.msgpack.decode(packed_data(data))
        numbers = np.frombuffer(table["state"]["memory"][0]).copy()
        numbers[0] += 1e-9  # the stamp that is remembered
        table["state"]["memory"][0] = numbers.tobytes()
        return packed_message(number, msgspec.msgpack.encode(table))

    return second, open_recording(changed(place, other, change))


def test_a_snapshot_that_does_not_follow_is_found(place, tmp_path):
    number, recorded = second_snapshot_changed(place, tmp_path / "b.mcap")
    verdict = verify(recorded)
    assert verdict.first.number == number
    assert verdict.first.field == "state before.memory.watch.stamp"


def test_steps_that_are_missing_are_passed_to_the_next_snapshot(place, tmp_path):
    def change(topic, number, data):
        return None if 50 <= number < 60 and topic in ("/pretouch/step", "/pretouch/inputs") else data

    made = open_recording(changed(place, tmp_path / "b.mcap", change))
    verdict = verify(made)
    second = made[snapshots(made)[1]].number
    assert verdict.first is None
    assert not verdict.agrees
    assert verdict.skipped == {"gone missing": 10, "no snapshot before": second - 60}
    assert "10 steps have gone missing" in verdict.sentence
    assert verdict.checked == 310 - (second - 60)


def test_inputs_that_are_missing_are_no_inputs_that_could_not_be_kept(place, tmp_path):
    gone = ("/pretouch/inputs", 50)
    recorded = open_recording(
        changed(place, tmp_path / "b.mcap", lambda topic, number, data: None if (topic, number) == gone else data)
    )
    assert recorded[50].inputs is None
    assert recorded[50].unreadable == "they are missing"
    verdict = verify(recorded)
    assert not verdict.agrees
    assert verdict.skipped["no inputs in the file"] == 1


def elsewhere(monkeypatch):
    monkeypatch.setattr(verifying, "versions", lambda: {"numpy": "9", "machine": "another"})


def test_other_versions_are_held_against_a_tolerance_and_named(place, tmp_path, monkeypatch):
    def shifted(size):
        change = {5: lambda s: replace(s, reason="Stopped by 9 Nm.", detail="9 Nm", path_phase=s.path_phase + size)}
        return verify(open_recording(steps_changed(place, tmp_path / f"{size}.mcap", change)))

    elsewhere(monkeypatch)
    verdict = shifted(9e-7)
    assert verdict.agrees, verdict.sentence
    assert not verdict.exact
    assert "within 1e-06" in verdict.sentence
    assert "here 9" in verdict.sentence
    verdict = shifted(2e-6)
    assert (verdict.first.number, verdict.first.field) == (5, "path_phase")


def test_within_a_tolerance_each_snapshot_is_a_new_start(place, tmp_path, monkeypatch):
    _, recorded = second_snapshot_changed(place, tmp_path / "b.mcap")
    elsewhere(monkeypatch)
    assert verify(recorded).agrees


def test_differences_of_numbers_that_are_none():
    a = np.array([np.nan, np.inf, -0.0, 1.0, np.nan, 1e9])
    b = np.array([np.nan, -np.inf, 0.0, 1.0, 2.0, 1e9 + 1])
    exact = [(part.field, part.size) for part in differing(a, b, True, "x")]
    assert exact == [("x[1]", np.inf), ("x[2]", 0.0), ("x[4]", np.inf), ("x[5]", 1.0)]
    assert [part.field for part in differing(a, b, False, "x")] == ["x[1]", "x[4]"]
    assert list(differing(window_init(3), window_init(3), True)) == []
    assert [part.field for part in differing((1, 2.0), (1, 2.0, 3), True, "t")] == ["t"]
    assert [part.field for part in differing(None, np.zeros(3), False, "contact")] == ["contact"]
