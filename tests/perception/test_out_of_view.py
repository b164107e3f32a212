"""A point from which the arm carries its unit's beam away is kept, and given up once its place is seen empty."""

from dataclasses import replace

import numpy as np
import pytest
from tests.perception.watcher import Watcher

from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.types import RangeStatus

KEPT_S = 1.0
NOTHING = (np.nan, RangeStatus.SIGNAL)
"""Too little light: nothing is near."""


class TurnedWatcher(Watcher):
    """Perception of the hand's left unit alone."""

    def __init__(self, model, skin, kept=KEPT_S):
        super().__init__(model, skin, no_fixtures(), replace(PROFILES["paper"].perception, out_of_view_s=kept))

    def at(self, now, turned, reading):
        """Points at an instant [s] with joint 1 turned by an angle [deg], a new reading of the unit."""
        self.q = self.model.description.q_ready + np.deg2rad(turned) * np.eye(7)[0]
        return self.see(now, reading[1], hand_left=reading[0]).point


OBJECT = (0.3, RangeStatus.OK)


@pytest.fixture
def watcher(panda_model, paper_skin):
    return TurnedWatcher(panda_model, paper_skin)


def test_a_point_is_kept_for_its_time_while_the_beam_goes_on(watcher):
    there = watcher.at(0.0, 0.0, OBJECT)
    assert len(there) == 1
    for now in (0.1, 0.5, 0.99):
        np.testing.assert_array_equal(watcher.at(now, 40 * now, NOTHING), there)
    assert len(watcher.at(1.02, 40.0, NOTHING)) == 0


def test_without_it_the_point_goes(panda_model, paper_skin):
    watcher = TurnedWatcher(panda_model, paper_skin, kept=0.0)
    watcher.at(0.0, 0.0, OBJECT)
    assert len(watcher.at(0.1, 4.0, NOTHING)) == 0


def test_of_an_arm_at_rest_it_goes_as_ever(watcher):
    watcher.at(0.0, 0.0, OBJECT)
    assert len(watcher.at(0.05, 0.0, NOTHING)) == 1, "one missed reading"
    assert len(watcher.at(0.1, 0.0, NOTHING)) == 0


def test_a_place_seen_empty_is_empty_when_the_beam_leaves_it_again(watcher):
    watcher.at(0.0, 0.0, OBJECT)
    assert len(watcher.at(0.1, 4.0, NOTHING)) == 1
    assert len(watcher.at(0.2, 0.0, NOTHING)) == 0
    assert len(watcher.at(0.3, 4.0, NOTHING)) == 0


@pytest.mark.parametrize(
    ("reading", "kept"),
    [((np.nan, RangeStatus.HARDWARE), True), ((1.2, RangeStatus.OK), False)],
    ids=["a failure tells nothing", "what lies behind it is seen"],
)
def test_only_a_look_through_its_place_says_that_it_is_empty(watcher, reading, kept):
    first = watcher.at(0.0, 0.0, OBJECT)
    watcher.at(0.1, 4.0, NOTHING)
    watcher.at(0.2, 0.0, reading)
    points = watcher.at(0.3, 4.0, NOTHING)
    assert any(np.array_equal(point, first[0]) for point in points) == kept


def test_what_is_seen_next_takes_its_place(watcher):
    watcher.at(0.0, 0.0, OBJECT)
    points = watcher.at(0.1, 4.0, (0.2, RangeStatus.OK))
    assert len(points) == 1
    np.testing.assert_array_equal(watcher.at(0.2, 8.0, NOTHING), points)
