"""What another profile would have decided: from a recording, held against what its own controller did."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.controller import Controller
from pretouch.errors import RecordingError
from pretouch.profiles import PROFILES, at_rate, profile
from pretouch.recording.compare import DetectedContact, compare, paired
from pretouch.recording.reader import open_recording
from pretouch.recording.writer import Recording
from pretouch.types import no_obstacles
from tests.following_arm import Arm
from tests.imported_data.files import pushed
from tests.reference.contact import Touch

PAPER, BLIND = PROFILES["paper"], PROFILES["blind"]
FORCE = pushed(5.4, ((1.5, 0.6, (0.0, 40.0, 0.0)), (4.5, 0.5, (-25.0, 0.0, 3.0))))


class Recorded(Arm):
    """An arm whose cycles are recorded."""

    def __init__(self, model, skin, place, used=PAPER):
        super().__init__(model, skin, used)
        self.recording = Recording(place, self.controller)
        self.steps = []

    def turn(self, force, seen=None, **more):
        cycle = super().turn(tuple(force), seen, **more)
        self.recording.record(cycle)
        self.steps.append(cycle.step)

    def switch(self, used):
        before = self.controller
        self.controller = Controller(self.model, self.skin, before.fixtures, before.path, used)
        self.state = self.controller.adopt(self.state, before)
        self.recording.change(self.controller)


@pytest.fixture
def arm(panda_model, paper_skin, tmp_path):
    return Recorded(panda_model, paper_skin, tmp_path / "run.mcap")


def played(arm, force, seen=None):
    for sample in force:
        arm.turn(sample, seen)
    arm.recording.close()
    return open_recording(arm.recording.place)


@pytest.fixture(scope="module")
def run(panda_model, paper_skin, tmp_path_factory):
    """An arm that was pushed beside an obstacle, and its recording."""
    arm = Recorded(panda_model, paper_skin, tmp_path_factory.mktemp("pushed") / "run.mcap")
    return arm, played(arm, FORCE, seen={0: 0.25})


def test_the_same_profile_decides_exactly_what_was_recorded(run):
    arm, recorded = run
    found = compare(recorded, PAPER)
    assert len(found.recorded.contacts) == 2
    assert [(c.time_s, *c.force_n) for c in found.other.contacts] == [
        (c.time_s, *c.force_n) for c in found.recorded.contacts
    ]
    for name in ("time", "force", "compared", "upper", "lower", "sigma", "armed", "reacting"):
        np.testing.assert_array_equal(getattr(found.recorded, name), getattr(found.other, name))
    np.testing.assert_array_equal(found.recorded.upper, [s.thresholds.upper for s in arm.steps])
    assert len(found.pairs) == 2
    assert all(other.time_s == recorded.time_s for recorded, other in found.pairs)
    assert found.left_out == 0


def test_another_profile_decides_what_the_plain_detector_does(run):
    found = compare(run[1], profile("blind:window.samples=60"))
    touch = Touch(BLIND.detect, replace(BLIND.window, samples=60))
    limits = [touch.feel(sample, np.zeros(3), no_obstacles())[0] for sample in FORCE]
    np.testing.assert_allclose(found.other.upper, [t.upper for t in limits], atol=1e-9)
    np.testing.assert_allclose(found.other.lower, [t.lower for t in limits], atol=1e-9)
    assert found.other.name == "blind:window.samples=60"
    assert np.any(found.recorded.upper < found.other.upper - 1.0) or np.any(
        found.recorded.lower > found.other.lower + 1.0
    )


def test_a_contact_that_only_one_finds_is_told_apart(run):
    found = compare(run[1], profile("blind:detect.f_base_n=20"))
    assert [round(c.time_s, 1) for c in found.recorded.contacts] == [1.6, 4.7]
    (recorded, other), alone = found.pairs
    assert other.time_s > recorded.time_s
    assert alone == (found.recorded.contacts[1], None)


def test_a_profile_for_another_rate_is_brought_to_that_of_the_run(run):
    found = compare(run[1], at_rate(PAPER, 1000.0))
    np.testing.assert_allclose(found.other.upper, found.recorded.upper, atol=1e-9)


def test_it_goes_on_through_a_change_of_profile(arm):
    for sample in FORCE[:400]:
        arm.turn(sample)
    arm.switch(replace(BLIND, detect=replace(BLIND.detect, f_base_n=30.0)))
    found = compare(played(arm, FORCE[400:]), PAPER)
    assert len(found.recorded.time) == len(found.other.time) == len(FORCE)
    assert [round(c.time_s, 1) for c in found.recorded.contacts] == [1.6]
    assert [round(c.time_s, 1) for c in found.other.contacts] == [1.6, 4.7]
    assert found.recorded.name == "paper, blind"


def test_a_recording_that_begins_with_a_full_window_is_not_filled_anew(arm):
    for sample in pushed(1.2, ()):
        arm.turn(sample)
    second = Recording(arm.recording.place.with_name("later.mcap"), arm.controller)
    arm.recording.close()
    arm.recording = second
    found = compare(played(arm, pushed(0.5, (), seed=8)), BLIND)
    assert found.other.armed.all()
    np.testing.assert_array_equal(found.recorded.upper, found.other.upper)


def test_cycles_without_inputs_are_left_out_and_counted_and_without_any_nothing_can_be_compared(arm):
    arm.turn((0, 0, 0), change=lambda robot: None)
    alone = arm.recording
    arm.recording = Recording(alone.place.with_name("more.mcap"), arm.controller)
    alone.close()
    with pytest.raises(RecordingError, match="no cycle with a usable robot state"):
        compare(open_recording(alone.place), PAPER)
    for i in range(20):
        arm.turn((0, 0, 0), change=lambda robot, i=i: None if i == 9 else robot)
    found = compare(played(arm, ()), PAPER)
    assert found.left_out == 1
    assert len(found.other.time) == 19


def at(*times):
    return [DetectedContact(t, np.zeros(3)) for t in times]


@pytest.mark.parametrize(
    ("first", "second", "pairs"),
    [
        (at(1.0, 5.0, 9.0), at(1.25, 1.4, 5.2, 4.9, 9.31),
         [(1.0, 1.25), (None, 1.4), (5.0, 4.9), (None, 5.2), (9.0, None), (None, 9.31)]),
        (at(1.0, 1.1), at(1.06), [(1.0, None), (1.1, 1.06)]),
    ],
)  # fmt: skip
def test_contacts_are_paired_once_with_the_nearest_within_three_tenths_of_a_second(first, second, pairs):
    assert [(a and a.time_s, b and b.time_s) for a, b in paired(first, second)] == pairs
