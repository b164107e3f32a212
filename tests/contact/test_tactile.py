"""What touch sensors say of a contact: the gain by hand, places, and what is not believed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.contact.alone import begun as feel_init
from tests.contact.alone import feel, sample, something, standing

from pretouch.contact.detector import Body
from pretouch.contact.scatter import earned_level, level_init
from pretouch.contact.sequential import alarm_bound
from pretouch.contact.touch_cue import Cues, gain_of, surface_areas, touch_cues, untouched
from pretouch.profiles import profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import TouchPatch
from pretouch.types import TouchReadings, TouchStatus, no_obstacles

P = profile("pretouch").detect.touch
PERIOD = 0.01
NOW = 5.0


def touching(skin: Skin, model: RobotModel, units: tuple[int, ...] = (0, 3), sigma: float = 0.0) -> Skin:
    """The skin with touch sensors at some units."""
    patch = TouchPatch(radius_m=0.02, force_min_n=0.5)
    return Skin(
        [replace(u, touch=patch, position_sigma=sigma) if k in units else u for k, u in enumerate(skin.units)], model
    )


def said(units: int, *touched: int, stamp: float = NOW) -> TouchReadings:
    contact = np.zeros(units, np.bool_)
    contact[list(touched)] = True
    return TouchReadings(np.full(units, stamp), contact, np.full(units, np.nan), np.zeros(units, np.int64))


class Sensors:
    """The touch sensors of an arm at rest, given readings."""

    def __init__(self, model: RobotModel, skin: Skin) -> None:
        self.body, self.kin = Body(model, skin, PERIOD), model.kinematics(model.description.q_ready)
        self.robot, self.state = standing(model), untouched(self.body, P)

    def cues(self, readings: TouchReadings | None) -> Cues | None:
        """What they say; None for nothing."""
        given = sample(self.kin, self.robot, no_obstacles(), NOW, readings)
        cues, self.state = touch_cues(self.state, self.body, given, P)
        return cues if len(cues.link) else None


def test_the_gain_by_hand():
    # false for 0.5 s once an hour: p = 1 / 7200; a patch on a hundredth of its link: 0.01 * 7200 + 0.99
    assert gain_of(np.array([0.01, 1.0]), P) == pytest.approx([72.99, 7200.0])


@given(st.floats(0.0, 1.0), st.floats(0.001, 3600.0), st.floats(0.01, 10.0))
def test_false_touches_at_the_rate_assumed_at_most_double_the_expectation(share, rate, length):
    p = replace(P, false_touches_per_hour=rate, false_touch_s=length)
    false = min(1.0, rate * length / 3600)
    gain = float(gain_of(np.array([share]), p)[0])
    assert gain >= 1.0 - 1e-12
    assert 1 - false + false * gain <= 1 + share + 1e-9


def test_the_surface_of_a_link_is_that_of_its_capsules():
    two = Capsules(np.array([1, 1, 2]), np.zeros((3, 3)), np.eye(3) * [0.1, 0.1, 0.1], np.array([0.05, 0.02, 0.5]))
    # 2 pi r l + 4 pi r^2: 0.0314159 + 0.0314159 + 0.0125664 + 0.0050265
    assert surface_areas(two, 4)[1] == pytest.approx(0.0804248, rel=1e-5)
    assert surface_areas(two, 4)[3] == np.inf


def test_units_that_say_nothing_and_skins_without_sensors_say_nothing(panda_model, paper_skin):
    assert not len(Sensors(panda_model, paper_skin).state)
    assert Sensors(panda_model, paper_skin).cues(said(len(paper_skin), 0)) is None
    skin = touching(paper_skin, panda_model)
    sensors = Sensors(panda_model, skin)
    for nothing in (None, said(len(skin)), said(len(skin), 1, 2, 4, 5, 6)):
        before = sensors.state
        assert sensors.cues(nothing) is None
        assert sensors.state is before


def test_a_touch_raises_the_prior_of_its_link_alone_and_tells_where_it_is(panda_model, paper_skin):
    skin = touching(paper_skin, panda_model, sigma=0.004)
    sensors = Sensors(panda_model, skin)
    cues = sensors.cues(said(7, 3))
    assert cues is not None
    link = int(skin.link[3])
    share = np.pi * 0.02**2 / surface_areas(panda_model.capsules, len(panda_model.links))[link]
    assert cues.gain[link] == pytest.approx(7200 * share + 1 - share)
    assert np.delete(cues.gain, link) == pytest.approx(1.0)
    assert cues.link.tolist() == [link]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = sensors.kin.rotation[link], sensors.kin.position[link]
    assert cues.point[0] == pytest.approx((T @ skin.T_link_sensor[3])[:3, 3])
    assert cues.sigma == pytest.approx([np.hypot(0.01, 0.004)])


def test_two_units_on_one_link_count_once(panda_model, paper_skin):
    skin = touching(paper_skin, panda_model, (0, 1))
    assert skin.link[0] == skin.link[1]
    one = Sensors(panda_model, skin).cues(said(7, 0))
    both = Sensors(panda_model, skin).cues(said(7, 0, 1))
    assert one is not None
    assert both is not None
    assert both.gain.tolist() == one.gain.tolist()
    assert len(both.link) == 2


@pytest.mark.parametrize(
    "change",
    [
        {"stamp": np.full(7, NOW - 0.07)},  # older than 60 ms
        {"stamp": np.full(7, NOW + 0.01)},  # a clock that is ahead
        {"stamp": np.full(7, -np.inf)},
        {"status": np.full(7, int(TouchStatus.FAILED))},
        {"status": np.full(7, int(TouchStatus.NONE))},
    ],
)
def test_what_is_old_early_or_of_a_failed_sensor_is_not_believed(panda_model, paper_skin, change):
    sensors = Sensors(panda_model, touching(paper_skin, panda_model))
    assert sensors.cues(replace(said(7, 0), **change)) is None


def test_a_sensor_that_is_stuck_is_believed_for_ten_seconds_and_comes_back_slowly(panda_model, paper_skin):
    sensors = Sensors(panda_model, touching(paper_skin, panda_model))
    believed = []

    def turns(seconds: float, readings: TouchReadings) -> None:
        for _ in range(round(seconds / PERIOD)):
            believed.append(sensors.cues(readings) is not None)

    turns(60.0, said(7, 0))
    assert abs(sum(believed) * PERIOD - 10.0) < 2 * PERIOD
    assert not any(believed[-1000:])
    turns(20.0, said(7))  # gives back 2 s
    believed.clear()
    turns(10.0, said(7, 0))
    assert abs(sum(believed) * PERIOD - 2.0) < 3 * PERIOD
    # the other unit has an account of its own
    cues = sensors.cues(said(7, 0, 3))
    assert cues is not None
    assert len(cues.link) == 1


def test_a_touch_counts_for_an_object_that_is_seen_at_its_link_and_no_touch_changes_no_bit(panda_model, paper_skin):
    skin = touching(paper_skin, panda_model)
    kin, link = panda_model.kinematics(panda_model.description.q_ready), int(skin.link[3])
    at, away = kin.position[link], np.array([0.0, 1.0, 0.0])
    torque = np.asarray(panda_model.jacobian(kin, link, at)[:3].T @ (-9.0 * away))
    ours, evidence = profile("pretouch"), []
    for felt_by, touched in ((None, None), (skin, ()), (skin, (3,))):
        state = feel_init(panda_model, ours, felt_by)
        for k in range(5):
            robot, seen = standing(panda_model, torque, stamp=0.02 * k), something(link, at, away, 0.01, 0.5, 0.25)
            touches = None if touched is None else said(7, *touched, stamp=0.02 * k)
            felt, state = feel(state, panda_model, kin, robot, seen, False, ours, True, felt_by, touches)
        evidence.append(felt.evidence)
    assert evidence[0] == evidence[1]
    # so many times the prior of what says most: ln G in units of ln A, but for what the other hypotheses add
    share = np.pi * 0.02**2 / surface_areas(panda_model.capsules, len(panda_model.links))[link]
    bound = alarm_bound(ours.detect, ours.task.control_period_s)
    gained = np.log(gain_of(share, P)) / earned_level(level_init()[1], bound, ours.detect.slack_nats)
    assert 0.8 * gained < evidence[2] - evidence[1] <= gained * (1 + 1e-9)
