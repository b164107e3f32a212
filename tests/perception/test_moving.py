"""Fixtures that move: what a unit sees of them is no obstacle, and what is nearest of them is one to keep off."""

import numpy as np
import pytest
from tests.perception.watcher import PARAMS, Watcher
from tests.sim.ranging import FORWARD, ORIGIN

from pretouch.perception.closest import beside, near_moving
from pretouch.robot.body import placed
from pretouch.robot.postures import segment_distance
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.scene import floor_and_pedestal
from pretouch.sound import sound_moving
from pretouch.types import MovingFixtures, RangeReadings

MARGIN_M = 0.06
"""Before a fixture, within which a reading is taken for it (`PerceptionParams.self_margin_m`)."""


def ball(center, radius=0.05, velocity=(0.0, 0.0, 0.0), stamp=0.0) -> MovingFixtures:
    at, v = np.array([center], dtype=float), np.array([velocity], dtype=float)
    return MovingFixtures(stamp, at, at, np.array([radius]), v, v)


def seen(model, moving: MovingFixtures | None, distance: float, now: float = 0.0) -> int:
    """How many obstacles a unit on the hand's front shows that reads a distance [m] 10 ms before."""
    watcher = Watcher(model, Skin([SensorUnit("ahead", "panda_hand", FORWARD)], model), floor_and_pedestal(-0.2))
    readings = RangeReadings(np.array([now - 0.01]), np.array([distance]), np.zeros(1, np.int64))
    still = watcher.controller.fixtures.capsules
    others = None if moving is None else beside(still, moving, readings, now, PARAMS.persistence_s)
    return len(watcher.take(readings, now, others).unit)


@pytest.mark.parametrize(
    ("aside", "speed", "now", "distance", "count"),
    [
        # the ball's surface is 0.4 m before the unit; its beam is along x
        ((0.45, 0.0, 0.0), 0.0, 0.0, 0.4, 0),
        ((0.45, 0.0, 0.0), 0.0, 0.0, 0.4 - 0.9 * MARGIN_M, 0),
        ((0.45, 0.0, 0.0), 0.0, 0.0, 0.5, 0),  # what is behind cannot be seen through it
        ((0.45, 0.0, 0.0), 0.0, 0.0, 0.4 - 1.2 * MARGIN_M, 1),  # a hand in front of it is still a person
        ((0.45, 0.0, 0.0), 0.0, 0.0, 0.15, 1),
        # beside the beam it explains nothing: half the cone's angle is 13.5 degrees, at 0.4 m it is 0.1 m wide
        ((0.4, 0.3, 0.0), 0.0, 0.0, 0.4, 1),
        # at 2 m/s it is now 0.2 m farther away than 0.1 s ago, and was at 0.4 m at the reading's stamp of 0.09 s
        ((0.45 - 2.0 * 0.09, 0.0, 0.0), 2.0, 0.1, 0.4, 0),
        ((0.45 - 2.0 * 0.09, 0.0, 0.0), 2.0, 0.1, 0.4 - 1.2 * MARGIN_M, 1),
    ],
)
def test_what_a_unit_sees_of_it_is_left_out_within_the_margin(panda_model, aside, speed, now, distance, count):
    assert seen(panda_model, None, distance, now) == 1
    other = ball(ORIGIN + np.array(aside), velocity=(speed, 0.0, 0.0))
    assert seen(panda_model, other, distance, now) == count


def test_of_each_link_the_nearest_place_is_an_obstacle(panda_model):
    kin = panda_model.kinematics(panda_model.description.q_ready)
    # 0.5 m beside the base, at the height of the hand's origin
    center = np.array([0.3, 0.5, 0.5])
    found = near_moving(ball(center, velocity=(0.0, -0.2, 0.0), stamp=1.0), panda_model, kin, 1.0, (7, 30))
    assert set(found.unit.tolist()) == {7}
    assert found.slot.tolist() == list(range(30, 30 + len(panda_model.parts)))
    assert not found.age.any()
    assert found.link.tolist() == panda_model.parts.tolist()
    # it slows nothing by eq. 3
    assert np.isinf(found.ee_distance).all()
    _, a, b, _ = placed(panda_model.body, kin)
    for k, link in enumerate(found.link):
        # the ball's distance from each capsule of the link, by its axis in ten thousand steps
        share = np.linspace(0.0, 1.0, 10_001)[:, None]
        gaps = [
            np.linalg.norm(a[c] + share * (b[c] - a[c]) - center, axis=1).min() - panda_model.body.radius[c] - 0.05
            for c in np.flatnonzero(panda_model.body.link == link)
        ]
        assert found.body_distance[k] == pytest.approx(min(gaps), abs=1e-6)
        # from the body's surface to the ball's, along the direction
        assert found.point[k] == pytest.approx(found.body_point[k] + found.body_distance[k] * found.direction[k])
        assert np.linalg.norm(found.point[k] - center) == pytest.approx(0.05)
        assert found.closing_speed[k] == pytest.approx(0.2 * found.direction[k][1])


def test_of_another_arm_the_nearest_capsules_are_found(panda_model):
    kin, rng = panda_model.kinematics(panda_model.description.q_ready), np.random.default_rng(0)
    a, b = rng.uniform(-0.8, 0.8, (2, 30, 3))
    b[:5] = a[:5]  # balls
    many = MovingFixtures(0.0, a, b, rng.uniform(0.02, 0.1, 30), np.zeros((30, 3)), np.zeros((30, 3)))
    found = near_moving(many, panda_model, kin, 0.0, (0, 0))
    (_, a_own, b_own, _), body = placed(panda_model.body, kin), panda_model.body
    gap = segment_distance(a_own[:, None], b_own[:, None], a[None], b[None]) - body.radius[:, None] - many.radius
    assert found.body_distance == pytest.approx([gap[body.link == link].min() for link in panda_model.parts])


def test_a_moving_axis_comes_nearer_as_fast_as_its_nearest_point(panda_model):
    kin = panda_model.kinematics(panda_model.description.q_ready)
    # a rod that turns about its lower end, to the arm
    rod = MovingFixtures(
        0.0, np.array([[0.9, 0.0, 0.0]]), np.array([[0.9, 0.0, 1.0]]), np.array([0.03]), np.zeros((1, 3)),
        np.array([[-0.4, 0.0, 0.0]]),
    )  # fmt: skip
    before, after = (near_moving(rod, panda_model, kin, t, (0, 0)) for t in (0.0, 1e-5))
    rate = (before.body_distance - after.body_distance) / 1e-5
    assert before.closing_speed == pytest.approx(rate, abs=1e-3)
    assert before.closing_speed.max() > 0.1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"a": np.zeros((2, 3))}, "MovingFixtures.b has the shape (1, 3), not (2, 3)"),
        ({"radius": np.array([-0.1])}, "have a radius of -0.1 m"),
        ({"b_velocity": np.full((1, 3), 1e3)}, "MovingFixtures.b_velocity holds 1000, no number below 100 in size"),
        ({"stamp": -0.2}, "0.200 s ago"),
        ({"stamp": np.nan}, "ago"),
    ],
)
def test_what_cannot_be_used_is_said(change, said):
    good = ball((1.0, 0.0, 0.5))
    assert sound_moving(good, 0.02, 0.05)[1] == ""
    found, wrong = sound_moving(good._replace(**change), 0.0, 0.05)
    assert found is None
    assert said in wrong


def test_something_else_than_moving_fixtures_is_said():
    assert sound_moving(None, 0.0, 0.05) == (None, "")
    none = np.zeros((0, 3))
    assert sound_moving(MovingFixtures(0.0, none, none, np.zeros(0), none, none), 9.0, 0.05) == (None, "")
    assert "7 is no MovingFixtures" in sound_moving(7, 0.0, 0.05)[1]
