"""The braking curve by numbers and in one dimension, and rows that come and go without a step."""

import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tests.examples import examples

from pretouch.control.braking import braking_cap, braking_numbers, braking_rows, slots_init
from pretouch.params.pretouch import BrakingParams, Tangential
from pretouch.robot.kinematics import Chain, tangents_of
from pretouch.types import SEEN_NOW_S, FloatArray, no_obstacles

DT, A, TOUCH, TASK, NOTICE = 0.01, 0.3, 0.03, 0.3, 0.6
TIGHTEN, LOOSEN, RETREAT, NEAR, SLOWEST = 3.0, 1.0, 0.1, 0.1, 0.1
UP = np.array([0.0, 0.0, 1.0])
unit_vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-3)


class Sled:
    """A body that one hinge a kilometre off moves along z: each joint velocity of 1/1000 rad/s is 1 m/s."""

    anchor, axis = np.array([[-1000.0, 0.0, 0.0]]), np.array([[0.0, -1.0, 0.0]])
    moved_by = np.array([[False], [True], [True]])

    def __init__(self, across: bool = False, slots: int = 1, margin: float = 0.0) -> None:
        self.slots = slots_init(slots)
        params = BrakingParams(
            d_notice_m=NOTICE, deceleration_m_s2=A, latency_s=0.0, margin_m=margin, retreat_max_m_s=RETREAT,
            touch_speed_m_s=TOUCH, tighten_m_s2=TIGHTEN, loosen_m_s2=LOOSEN,
            tangential=Tangential(distance_m=NEAR, speed_m_s=SLOWEST) if across else None,
        )  # fmt: skip
        self.numbers = braking_numbers(params, TASK, DT)
        self.untouched, self.age = (sys.maxsize, 0.0, np.inf), 0.0

    def rows(
        self, speed: float, seen: dict[int, tuple[int, float]], closing: float = 0.0, normal: FloatArray = UP
    ) -> tuple[int, FloatArray, FloatArray]:
        """Rows of what is seen, {slot: (link, distance)}: how many are of that, G in m/s, h."""
        k = len(seen)
        obstacles = no_obstacles(k)._replace(
            slot=np.array(list(seen), np.int64), link=np.array([link for link, _ in seen.values()], np.int64),
            direction=np.tile(normal, (k, 1)), body_distance=np.array([d for _, d in seen.values()]),
            closing_speed=np.full(k, closing), age=np.full(k, self.age),
        )  # fmt: skip
        chain = Chain(self.anchor, self.axis, self.moved_by, np.array([speed / 1000.0]))
        rows = braking_rows(self.numbers, self.slots, obstacles, chain, (TOUCH, 0.0, *self.untouched))
        return len(rows.which), rows.G[:, 0] / 1000.0, rows.h


def test_what_is_not_to_be_touched_is_not_approached_at_its_surface():
    seen, kept_off = Sled(), Sled()
    kept_off.untouched = 0, 0.0, np.inf
    for sled, least in ((seen, TOUCH), (kept_off, 0.0)):
        for _ in range(2000):
            _, _, h = sled.rows(0.0, {0: (1, 0.0)})
        assert h == pytest.approx([least])
        # v^2 = v_c^2 + 2 a d
        for _ in range(2000):
            _, _, h = sled.rows(0.0, {0: (1, 0.08)})
        assert h == pytest.approx([np.sqrt(least**2 + 2 * A * 0.08)])


# stop, then touch: what was seen in the last 6 s is not touched, at a margin of 2 cm


def stopping(age: float) -> Sled:
    sled = Sled(margin=0.02)
    sled.untouched, sled.age = (sys.maxsize, 6.0, np.inf), age
    return sled


@pytest.mark.parametrize(
    ("age", "distance", "limit"),
    [
        (5.99, 0.02, 0.0),
        (6.0, 0.02, TOUCH),
        # within the margin back to it, by 4 m/s for each metre
        (5.99, 0.01, -0.04),
        (0.0, -0.03, -RETREAT),
        (6.0, -0.03, TOUCH),
        # 19 mm before it, sqrt(2 * 0.3 * 0.019), at once
        (5.99, 0.039, np.sqrt(2 * A * 0.019)),
        # and 21 mm before it as a row tightens
        (5.99, 0.041, 0.3 - TIGHTEN * DT),
    ],
)
def test_what_was_seen_lately_is_not_touched_and_limits_at_once_near_the_margin(age, distance, limit):
    if limit == TOUCH:  # not at once
        sled = stopping(age)
        for _ in range(50):
            h = sled.rows(TOUCH, {0: (1, distance)})[2]
    else:
        h = stopping(age).rows(0.3, {0: (1, distance)})[2]
    assert h == pytest.approx([limit])


def test_an_arm_that_keeps_the_limit_never_comes_nearer_than_the_margin():
    sled, d, v = stopping(0.0), 0.3, 0.3
    for _ in range(1000):
        v = min(0.3, *sled.rows(v, {0: (1, d)})[2])
        d -= v * DT
    assert 0.02 - 1e-9 <= d < 0.0201


def test_while_a_contact_moves_the_arm_only_what_is_seen_now_counts():
    sled = stopping(0.0)
    sled.untouched = sys.maxsize, 0.0, SEEN_NOW_S
    for age, rows in ((0.29, 1), (0.31, 0)):
        sled.age = age
        assert sled.rows(0.0, {0: (1, 0.0)})[0] == rows
    assert SEEN_NOW_S == 0.3


def test_the_curve_by_numbers():
    # no latency, no margin: sqrt(0.03^2 + 2 * 0.3 * 0.1) = 0.2467793
    assert braking_cap(0.1, 0.03, 0.3, 0.0, 0.0) == pytest.approx(np.sqrt(0.0009 + 0.06))
    assert braking_cap(0.0, 0.03, 0.3, 0.06, 0.01) == 0.03
    assert braking_cap(-0.2, 0.03, 0.3, 0.06, 0.01) == 0.03
    # binds 0.3 m/s from (0.3^2 - 0.03^2) / (2 * 0.3) = 0.1485 m on
    assert braking_cap(0.1485, 0.03, 0.3, 0.0, 0.0) == pytest.approx(0.3)


@given(st.floats(-0.1, 1.0), st.floats(0.005, 0.1), st.floats(0.05, 2.0), st.floats(0.0, 0.2), st.floats(0.0, 0.05))
def test_the_curve_is_the_fixed_point_of_its_equation(d, touch, a, latency, margin):
    v = braking_cap(d, touch, a, latency, margin)
    assert v == pytest.approx(np.sqrt(touch**2 + 2 * a * max(0.0, d - v * latency - margin)), abs=1e-9)


@given(st.floats(-0.2, 1.0), st.floats(0.0, 0.02))
def test_the_curve_grows_with_the_distance_and_jumps_nowhere(d, step):
    near, far = (braking_cap(x, 0.03, 0.3, 0.06, 0.01) for x in (d, d + step))
    assert near <= far
    assert far - near <= np.sqrt(2 * 0.3 * step) + 1e-12


@given(st.floats(0.0, 0.6), st.floats(0.05, 1.0), st.floats(0.005, 0.1))
def test_a_point_that_keeps_the_cap_brakes_at_a_and_touches_at_the_touch_speed(start, a, touch):
    d, v = start, braking_cap(start, touch, a, DT, 0.0)
    for _ in range(2000):
        slower = min(v, braking_cap(d, touch, a, DT, 0.0))
        assert v - slower <= a * DT + 1e-9
        v = slower
        # what is left always lets it brake to the touch speed
        assert v**2 <= touch**2 + 2 * a * max(0.0, d) + 1e-12
        if d <= 0:
            break
        d -= v * DT
    assert d > 0 or v <= touch + 1e-12


@pytest.mark.parametrize("speed", [0.3, 0.1, -0.4])
def test_a_row_that_appears_slows_the_arm_no_harder_than_it_tightens(speed):
    # from 0.3 m/s tightening at 3 m/s^2 takes (0.3^2 - 0.03^2) / 6 = 14.85 mm
    found, G, h = Sled().rows(speed, {0: (1, 0.015)})
    assert found == len(G) == 1
    assert G[0] == pytest.approx(1.0)
    assert h[0] == pytest.approx(max(speed - TIGHTEN * DT, np.sqrt(TOUCH**2 + 2 * A * 0.015)))


def test_what_appears_too_near_for_that_is_braked_for_at_once():
    # 5 mm ahead the speed from which 3 m/s^2 would do is sqrt(0.03^2 + 2 * 3 * 0.005)
    assert Sled().rows(0.3, {0: (1, 0.005)})[2][0] == pytest.approx(np.sqrt(TOUCH**2 + 2 * TIGHTEN * 0.005))
    assert Sled().rows(0.3, {0: (1, 0.0)})[2][0] == pytest.approx(TOUCH)
    # and for what comes nearer by itself the arm stops at once, but retreats no faster than the rate
    assert Sled().rows(0.3, {0: (1, 0.005)}, closing=2.0)[2][0] == 0.0
    assert Sled().rows(0.0, {0: (1, 0.005)}, closing=2.0)[2][0] == pytest.approx(-TIGHTEN * DT)


def test_beyond_notice_there_is_no_row_and_from_there_on_none_that_binds():
    sled = Sled()
    assert sled.rows(0.3, {0: (1, NOTICE)})[0] == 0
    assert sled.rows(0.3, {0: (1, NOTICE - 1e-9)})[2][0] > 2 * TASK - 0.01


def test_an_object_that_comes_nearer_leaves_the_arm_less_down_to_a_slow_retreat():
    target = np.sqrt(TOUCH**2 + 2 * A * 0.05)
    assert Sled().rows(0.0, {0: (1, 0.05)}, closing=0.1)[2][0] == pytest.approx(target - 0.1)
    sled = Sled()
    for _ in range(50):
        h = sled.rows(-0.1, {0: (1, 0.05)}, closing=2.0)[2][0]
    assert h == pytest.approx(-RETREAT)
    # one that goes away allows no more
    assert Sled().rows(0.0, {0: (1, 0.05)}, closing=-1.0)[2][0] == pytest.approx(target)


def test_no_row_limits_a_retreat():
    for across in (False, True):
        found, G, h = Sled(across).rows(-10.0, {0: (1, 0.0)}, closing=2.0)
        assert found == 1
        assert np.all(h >= -10.0 * G)


def test_what_is_no_longer_seen_lets_go_at_one_rate():
    sled = Sled()
    last = sled.rows(0.03, {0: (1, 0.0)})[2][0]
    assert last == pytest.approx(TOUCH)
    for _ in range(int((np.sqrt(2 * A * NOTICE) - TOUCH) / LOOSEN / DT)):
        found, G, h = sled.rows(0.03, {})
        assert found == 0
        assert len(G) == 1
        assert h[0] == pytest.approx(last + LOOSEN * DT)
        last = h[0]
    sled.rows(0.03, {})
    assert len(sled.rows(0.03, {})[1]) == 0
    assert np.all(sled.slots.link == -1)


def test_a_point_seen_again_goes_on_from_where_its_row_had_come():
    sled = Sled()
    sled.rows(0.03, {0: (1, 0.0)})
    for _ in range(3):
        sled.rows(0.03, {})
    assert sled.rows(0.03, {0: (1, 0.3)})[2][0] == pytest.approx(TOUCH + 4 * LOOSEN * DT)


def test_the_row_of_another_closest_link_starts_at_the_speed_of_the_arm():
    sled = Sled()
    sled.rows(0.03, {0: (1, 0.0)})
    found, G, h = sled.rows(0.03, {0: (2, 0.1)})
    assert found == len(G) == 1
    assert h[0] == pytest.approx(np.sqrt(TOUCH**2 + 2 * A * 0.1))


@examples(100, least=50)
@given(
    st.lists(st.tuples(st.booleans(), st.integers(1, 2), st.floats(-0.05, 0.7), st.floats(-2, 2)), max_size=60),
    st.booleans(),
)
def test_whatever_is_seen_the_arm_is_slowed_and_let_go_at_no_more_than_the_rates(readings, across):
    sled, v = Sled(across), 0.3
    for shown, link, d, closing in readings:
        _, G, h = sled.rows(v, {0: (link, d)} if shown else {}, closing)
        assert np.isfinite(G).all()
        assert np.isfinite(h).all()
        # the fastest that all rows allow, of what the task asks for
        allowed = min([0.3, *(h[G > 1e-6] / G[G > 1e-6]).tolist()])
        last = braking_cap(d, TOUCH, TIGHTEN, 0.0, 0.0) - max(0.0, closing) if shown else np.inf
        assert allowed >= min(v - TIGHTEN * DT, max(0.0, last)) - 1e-9
        assert allowed >= -RETREAT - 1e-9
        v = min(allowed, v + LOOSEN * DT)


def test_the_cap_across_the_normal_grows_with_the_distance_to_the_tasks_speed():
    level = np.array([1.0, 0.0, 0.0])
    for d, cap in ((0.0, 0.1), (-0.03, 0.1), (0.05, 0.2), (0.0999, 0.2998)):
        sled = Sled(across=True)
        _, G, h = sled.rows(0.0, {0: (1, d)}, normal=level)
        assert len(G) == 5
        np.testing.assert_allclose(h[1:], cap, atol=1e-12)
        # the sled moves across x: both ways are capped, each by one row
        assert sorted(G[1:].round(9).tolist()) == [-1.0, 0.0, 0.0, 1.0]
    assert len(Sled(across=True).rows(0.0, {0: (1, NEAR)}, normal=level)[1]) == 1


def test_the_cap_across_the_normal_appears_and_goes_at_the_rates():
    level, sled = np.array([1.0, 0.0, 0.0]), Sled(across=True)
    _, G, h = sled.rows(0.3, {0: (1, 0.0)}, normal=level)
    assert h[1:][G[1:] > 0.5] == pytest.approx(0.3 - TIGHTEN * DT)
    before = float(sled.slots.across[0])
    sled.rows(0.1, {0: (1, 0.3)}, normal=level)
    assert sled.slots.across[0] == pytest.approx(before + LOOSEN * DT)


@given(unit_vectors)
@example(UP)
@example(-UP)
@example(np.array([1.0, 0.0, 0.0]))
@example(np.array([0.0, 1.0, 0.0]))
@example(np.ones(3))
def test_tangents_are_across_the_normal_whatever_it_is(v):
    n, t = v / np.linalg.norm(v), np.empty((2, 3))
    tangents_of(n, t)
    np.testing.assert_allclose(np.vstack([n, t]) @ np.vstack([n, t]).T, np.eye(3), atol=1e-12)


def test_obstacles_keep_their_rows_apart():
    sled = Sled(slots=3)
    found, _, h = sled.rows(0.0, {0: (1, 0.0), 2: (2, 0.2)})
    assert found == 2
    assert h[0] == pytest.approx(TOUCH)
    assert h[1] == pytest.approx(np.sqrt(TOUCH**2 + 2 * A * 0.2))
    assert sled.slots.link.tolist() == [1, -1, 2]
    assert sled.slots.limit[0] == pytest.approx(TOUCH)
