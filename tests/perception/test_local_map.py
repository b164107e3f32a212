"""What was seen stays where it was until it is seen empty or is old, and which places of it are obstacles."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.examples import examples
from tests.following_arm import Arm
from tests.perception.watcher import HAND_LEFT, TCP, Watcher, readings_of

from pretouch.params import LocalMapParams, OutsidePoints, PerceptionParams
from pretouch.perception.local_map import MOST_PLACES, LocalMap
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.sensing.sensor import VL53L1X, VL53L5CX, VL53L7CX, Sensor
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RangeReadings, RangeStatus, SeenPoints

MAP = LocalMapParams()
PARAMS = PerceptionParams(memory=MAP, outside=OutsidePoints())
LEFT = np.array([0.0, 1.0, 0.0])
"""Beam of the unit hand_left in the ready posture."""


class Looker(Watcher):
    """Perception of the hand's left unit, or of several at its place, one sensor each."""

    def __init__(self, model, unit, *sensors: Sensor, params: PerceptionParams = PARAMS) -> None:
        sensors = sensors or (VL53L1X(),)
        units = [replace(unit, id=f"u{i}", sensor=sensor) for i, sensor in enumerate(sensors)]
        super().__init__(model, Skin(units, model), no_fixtures(), params)

    @property
    def places(self) -> LocalMap:
        """What is remembered."""
        whole = self.memory.part("places", LocalMap)
        return LocalMap(whole.number, *(part[: whole.number[0]] for part in whole[1:]))

    def turn(self, degrees: float) -> None:
        """Turn joint 1 from the ready posture."""
        self.q = self.model.description.q_ready + np.deg2rad(degrees) * np.eye(7)[0]

    def look(self, now: float, distance: float | None, board: int = 0, stamp: float | None = None) -> Obstacles:
        """Take a reading in of all zones of one unit; None: no target."""
        mine = np.array([name == f"u{board}" for name in self.skin.boards])
        status = RangeStatus.SIGNAL if distance is None else RangeStatus.OK
        return self.take(
            RangeReadings(
                np.where(mine, now if stamp is None else stamp, -np.inf),
                np.full(len(mine), np.nan if distance is None else distance),
                np.where(mine, int(status), int(RangeStatus.NONE)),
            ),
            now,
        )

    def wait(self, now: float) -> Obstacles:
        """Take a step without a reading."""
        return self.take(readings_of(self.skin, now), now)


@pytest.fixture
def unit(paper_skin):
    return paper_skin.units[paper_skin.ids.index("hand_left")]


@pytest.fixture
def looker(panda_model, unit):
    return Looker(panda_model, unit)


def seen_three_times(looker: Looker, distance: float = 0.3) -> Obstacles:
    """Obstacles after three looks, at 1.0, 1.02 and 1.04 s."""
    for now in (1.0, 1.02, 1.04):
        near = looker.look(now, distance)
    return near


# a place, and how long it stays


def test_a_look_is_remembered_as_a_ball_behind_the_surface(looker):
    near = looker.look(1.0, 0.3)
    np.testing.assert_allclose(looker.places.place, [HAND_LEFT + 0.34 * LEFT], atol=1e-4)
    np.testing.assert_allclose(near.point, [HAND_LEFT + 0.3 * LEFT], atol=2e-3)
    assert near.body_distance == pytest.approx(0.305, abs=2e-3)  # the unit sits 5 mm above the surface
    assert near.ee_distance == pytest.approx(np.linalg.norm(near.point - TCP))
    assert looker.model.parts[near.slot[0] // MAP.per_link] == near.link[0]
    assert (near.unit.tolist(), near.age.tolist()) == ([0], [0.0])
    # half of 27 degrees at 0.3 m: 72 mm
    assert looker.places.width == pytest.approx([0.3 * np.tan(np.deg2rad(13.5))])


def test_one_look_alone_lasts_as_long_as_its_reading_and_two_much_longer(looker):
    looker.look(1.0, 0.3)
    assert len(looker.wait(1.059).unit) == 1
    assert len(looker.wait(1.061).unit) == 0
    looker.look(2.0, 0.3)
    looker.look(2.02, 0.3)
    assert looker.wait(2.02 + MAP.kept_s - 0.01).age == pytest.approx([MAP.kept_s - 0.01])
    assert len(looker.wait(2.02 + MAP.kept_s + 0.01).unit) == 0


def test_a_place_stays_where_it_is_when_the_arm_carries_the_beam_away(looker):
    there = seen_three_times(looker)
    for i in range(1, 101):
        looker.turn(-20.0 - 0.2 * i)
        near = looker.look(1.04 + 0.02 * i, None)
    assert near.age == pytest.approx([2.0])
    np.testing.assert_allclose(looker.places.place, [HAND_LEFT + 0.34 * LEFT], atol=1e-4)
    looker.turn(0.0)
    np.testing.assert_allclose(looker.wait(3.06).point, there.point, atol=1e-9)


@pytest.mark.parametrize("beyond", [1.2, None], ids=["what is behind it", "no target"])
def test_a_place_goes_after_three_looks_that_see_it_empty_and_not_before(looker, beyond):
    seen_three_times(looker)
    counts = [len(looker.look(1.06 + 0.02 * i, beyond).unit) for i in range(4)]
    assert counts == [1, 1, 0, 0]


@pytest.mark.parametrize(("reading", "stays"), [(0.34, True), (0.36, False)])
def test_what_is_within_the_tolerance_of_a_reading_is_not_empty(looker, reading, stays):
    seen_three_times(looker)
    for i in range(3):
        looker.look(1.06 + 0.02 * i, reading)
    there = np.linalg.norm(looker.places.place - HAND_LEFT - 0.34 * LEFT, axis=1) < 1e-3
    assert there.any() == stays


@pytest.mark.parametrize("status", [RangeStatus.HARDWARE, RangeStatus.SYNC, RangeStatus.CROSSTALK])
def test_a_failure_and_a_silence_show_no_place_empty(looker, status):
    seen_three_times(looker)
    for i in range(30):
        now = 1.06 + 0.02 * i
        near = looker.take(RangeReadings(np.array([now]), np.array([np.nan]), np.array([int(status)])), now)
    assert near.age == pytest.approx([0.6])
    assert looker.wait(2.64).age == pytest.approx([1.6])


def test_far_away_nothing_is_seen_empty_and_farther_nothing_is_remembered(looker):
    seen_three_times(looker, MAP.carve_m - MAP.fist_m + 0.01)
    for i in range(5):
        assert len(looker.look(1.06 + 0.02 * i, None).unit) == 1
    looker.look(1.2, MAP.mark_m + 0.01)
    assert len(looker.places.stamp) == 1


def test_no_target_counts_after_the_longest_burst_of_its_sensor(panda_model, unit):
    sensor = VL53L7CX()
    looker, frame = Looker(panda_model, unit, sensor), 1 / 60
    for i in range(3):
        there = len(looker.look(1.0 + i * frame, 0.3).unit)
    last = 1.0 + 2 * frame
    frames = [last + i * frame for i in range(1, 60)]
    counts = [len(looker.look(now, None).unit) for now in frames]
    in_burst = [count for now, count in zip(frames, counts, strict=True) if now - last <= sensor.blind_s]
    assert in_burst == [there] * len(in_burst)
    # one more, for the burst begins with the first of them, and then three looks
    assert counts[len(in_burst) + 2] > 0
    assert counts[len(in_burst) + 3] == 0


def test_a_late_reading_says_nothing_of_what_was_seen_after_it(panda_model, unit):
    looker = Looker(panda_model, unit, VL53L1X(), VL53L1X())
    seen_three_times(looker)
    for stamp in (1.005, 1.01, 1.015, 1.03):
        looker.look(1.05, 1.2, board=1, stamp=stamp)
    assert looker.places.looks.tolist() == [MAP.looks]
    looker.look(1.06, 1.2, board=1)
    assert looker.places.looks.tolist() == [MAP.looks - 1]


def test_a_place_is_seen_empty_from_where_its_unit_is_though_the_first_zone_says_nothing(panda_model, unit):
    looker = Looker(panda_model, unit, VL53L7CX())
    for i in range(3):
        looker.look(1.0 + 0.02 * i, 0.3)
    for i in range(3):
        now = 1.06 + 0.02 * i
        stamp = np.where(np.arange(16) == 0, -np.inf, now)
        looker.take(RangeReadings(stamp, np.full(16, 0.6), np.zeros(16, np.int64)), now)
    # what the first zone saw stays
    assert (np.linalg.norm(looker.places.place - HAND_LEFT, axis=1) < 0.4).sum() == 1


def test_a_nearer_look_takes_the_place_of_a_wider_one(panda_model, unit):
    for narrow_first in (False, True):
        looker = Looker(panda_model, unit, VL53L1X(), VL53L5CX())
        order = (1, 0) if narrow_first else (0, 1)
        for now, board in ((1.0, order[0]), (1.02, order[0]), (1.04, order[1]), (1.06, order[1])):
            looker.look(now, 0.5, board)
        wide = looker.places.unit == 0
        # at 0.5 m a cone of 27 degrees is 0.12 m wide to each side, and one of a zone of 11 degrees 0.056 m
        assert wide.any() == narrow_first
        assert not wide.all()


def test_what_the_arm_comes_to_be_in_is_empty(panda_model, unit):
    looker = Looker(panda_model, unit)
    looker.turn(40.0)
    at = looker.model.kinematics(looker.q).position[looker.model.link_index("panda_hand")]
    looker.turn(0.0)
    points = SeenPoints(1.0, np.ones(1), at[None], np.zeros(1))
    assert len(looker.take(readings_of(looker.skin, 1.0), 1.0, points=points).unit) == 1
    looker.turn(40.0)
    assert len(looker.wait(1.02).unit) == 0
    looker.turn(0.0)
    assert len(looker.wait(1.04).unit) == 0


def test_below_the_sensors_minimum_a_target_is_never_absent_and_what_was_nearer_stays(looker):
    near = looker.see(1.0, RangeStatus.MIN_RANGE, u0=np.nan)
    assert near.body_distance == pytest.approx(0.045, abs=2e-3)
    # the place is where it was, and the arm has come to 20 mm of it
    seen_three_times(looker, 0.06)
    looker.q = looker.q + np.deg2rad(6.0) * np.eye(7)[0]
    nearest = min(looker.wait(1.05).body_distance)
    for i in range(10):
        near = looker.see(1.06 + 0.02 * i, RangeStatus.MIN_RANGE, u0=np.nan)
    assert nearest < 0.035
    assert nearest - 0.005 < near.body_distance.min() <= nearest
    assert near.age[np.argmin(near.body_distance)] == 0.0


# zones


def test_the_corner_of_a_zone_sensor_sees_where_its_beam_goes(panda_model, unit):
    looker = Looker(panda_model, unit, VL53L7CX())
    stamp = np.where(np.arange(16) == 15, 1.0, -np.inf)
    looker.take(RangeReadings(stamp, np.full(16, 0.3), np.zeros(16, np.int64)), 1.0)
    # zones of 15 degrees: the last one looks by 22.5 degrees along x and y of the sensor
    beam = np.array([np.tan(np.deg2rad(22.5)), np.tan(np.deg2rad(22.5)), 1.0])
    T = panda_model.kinematics(looker.q).rotation[panda_model.link_index("panda_hand")] @ unit.T_link_sensor[:3, :3]
    np.testing.assert_allclose(looker.places.place, [HAND_LEFT + 0.34 * T @ beam / np.linalg.norm(beam)], atol=1e-4)
    assert looker.places.unit.tolist() == [15]


def test_eight_by_eight_zones_are_not_too_old_nor_silent_between_their_frames(panda_model, unit):
    sensor = VL53L7CX(zones=8)
    looker = Looker(panda_model, unit, sensor)
    late, arrivals = sensor.timing[1], 1.0 + np.arange(12) / 15
    for now in np.arange(1.0, 1.7, 0.01):
        frame = arrivals[arrivals <= now + 1e-9][-1]
        near = looker.look(now, 0.3, stamp=frame - late)
        assert len(near.unit) >= 1
        assert looker.now.get("scene.silence_scale") == 1.0
    # one of three frames is lost: the arm still does not slow
    looker.wait(1.0 + 10 / 15 + 0.19)
    assert looker.now.get("scene.silence_scale") == 1.0


# which places are obstacles


def test_a_full_map_loses_the_oldest_and_takes_the_newest_at_the_next_look(panda_model, unit):
    looker = Looker(panda_model, unit)
    grid = np.stack(np.meshgrid(*(0.0201 * np.arange(60) - 0.6,) * 3), axis=-1).reshape(-1, 3) + TCP
    many = grid[np.random.default_rng(0).permutation(len(grid))[:20_000]]

    def see(now: float, points: np.ndarray) -> Obstacles:
        new = SeenPoints(now, np.full(len(points), now), points, np.zeros(len(points)))
        return looker.take(readings_of(looker.skin, now), now, points=new)

    see(1.0, many)
    assert len(looker.places.stamp) == MOST_PLACES
    hand = TCP + 0.3 * LEFT + 0.0101
    for now in (1.01, 1.02):
        see(now, hand[None])
    assert len(looker.places.stamp) == MOST_PLACES
    newest = looker.places.stamp == 1.02
    np.testing.assert_array_equal(looker.places.place[newest], [hand])


# motion


def test_what_comes_has_a_closing_speed_and_what_rests_has_none(looker):
    for i in range(30):
        near = looker.look(1.0 + 0.02 * i, 0.7 - 0.01 * i)
    nearest = np.argmin(near.body_distance)
    assert near.closing_speed[nearest] == pytest.approx(0.5, abs=0.02)
    assert looker.wait(1.62).closing_speed.max() == pytest.approx(0.5, abs=0.02)
    assert not looker.wait(1.74).closing_speed.any(), "it is believed for 0.15 s"
    for i in range(40):
        near = looker.look(2.0 + 0.02 * i, 0.4)
    assert np.abs(near.closing_speed).max() < 0.01


@examples(50, least=20)
@given(
    st.lists(st.floats(0.0, 1.3) | st.none(), min_size=1, max_size=20),
    st.lists(st.floats(1e-4, 0.5), min_size=20, max_size=20),
)
def test_whatever_is_read_obstacles_are_whole_and_as_fast_as_a_hand_at_most(panda_model, paper_skin, distances, gaps):
    looker = Looker(panda_model, paper_skin.units[0])
    for now, distance in zip(1.0 + np.cumsum(gaps), distances, strict=False):
        near = looker.look(now, distance)
        for part in near:
            assert np.isfinite(part).all()
        assert (np.abs(near.closing_speed) <= 2.0).all()
        assert ((near.age >= 0.0) & (near.age <= MAP.kept_s)).all()
        np.testing.assert_allclose(np.linalg.norm(near.direction, axis=1), 1.0)
        np.testing.assert_allclose(
            near.point, near.body_point + near.body_distance[:, None] * near.direction, atol=1e-9
        )  # fmt: skip


# in the controller


def test_time_that_goes_backwards_empties_the_map(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PROFILES["pretouch"])
    arm.run(3, seen={0: 0.3})
    assert arm.state.memory.get("places.number") > 0
    arm.time -= 0.5
    assert len(arm.step().obstacles.unit) == 0
