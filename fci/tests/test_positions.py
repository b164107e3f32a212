"""Motions through joint positions, by raw bytes."""

import time

import numpy as np
import pytest
from fci.tests.conftest import errors_of, smooth

_MS = 1e-3
_JOINT_7 = np.eye(7)[6]


@pytest.mark.parametrize(("drop", "rate", "off"), [("", 1.0, 1e-6), ("2/50", 0.96, 1e-5)])
def test_the_arm_is_where_commands_say_though_some_are_lost(serve, raw, kind, drop, rate, off):
    client = raw(serve(kind, drop=drop))
    state = client.begun(0)
    start = state["q_d"].astype(np.float64)
    for k in range(1, 2001):
        q = start + 0.3 * smooth(k, 2000) * np.array([1, 0, 0, 0, 0, 0, 1])
        state = client.moved(state, q)
        if not drop:
            np.testing.assert_allclose(state["q_d"], q, atol=off)
    np.testing.assert_allclose(state["q_d"], q, atol=off)
    assert state["control_command_success_rate"] == pytest.approx(rate)
    for _ in range(3 if drop else 1):  # the first two are lost
        state = client.turn(state, q, finished=True)
    assert client.ended() == "success"
    after = client.state()
    np.testing.assert_allclose(after["q"], after["q_d"], atol=5e-3)


@pytest.mark.parametrize(
    ("kind", "off"), [("panda", 0.2), ("panda", 1e-3), ("panda", -2e-5), ("panda", None), ("fr3", 0.2), ("fr3", 2e-3)]
)
def test_the_first_position_must_be_where_the_arm_is(serve, raw, kind, off):
    """Without an offset it is the common mistake: a Panda begins at q_d, and not at q."""
    client = raw(serve(kind))
    state = client.begun(0)
    after = client.turn(state, state["q"] if off is None else state["q_d"] + off)
    assert client.ended() == "reflex"
    assert errors_of(after) == ["joint_position_motion_generator_start_pose_invalid"]
    np.testing.assert_array_equal(after["q_d"], state["q_d"])


def test_an_fr3_may_begin_where_it_measurably_is(serve, raw):
    client = raw(serve("fr3"))
    state = client.begun(0)
    q = state["q"].astype(np.float64)
    assert np.max(np.abs(q - state["q_d"])) > 2e-5  # farther than a millisecond goes
    state = client.turn(state, q)
    np.testing.assert_allclose(state["q_d"], q, atol=1e-6)
    np.testing.assert_array_equal(state["dq_d"], np.zeros(7))
    for k in range(1, 51):
        q = q + 1e-3 * k * _MS * _JOINT_7
        state = client.moved(state, q)


def test_in_real_time_the_first_states_of_a_motion_wait_for_their_answer_too(serve, raw):
    """libfranka filters the second command with what the robot took of the first, which must not be lost."""
    client = raw(serve("fr3", lockstep=False, grace=0.1))
    client.begun(0)
    at = [time.monotonic()]
    for _ in range(30):
        client.state()
        at.append(time.monotonic())
    assert at[5] - at[0] > 0.4
    assert min(np.diff(at[6:])) < 0.1  # a client that loads its model first is not waited for
