"""The vendor's force is that of the arm on its environment; ours is the opposite. Pinned from value to reaction."""

import numpy as np
import pytest

from pretouch.arms.franka.state import FrankaState, error_names, packed, robot_state, unpacked
from pretouch.contact.reaction import DecayingVelocity
from tests.arms.franka.made import state


def test_a_push_on_the_arm_is_negative_for_the_vendor_positive_for_us_and_moves_the_arm_along() -> None:
    vendor = np.array([0.0, -20.0, 0.0, 0.0, 0.0, -4.0])  # a hand pushes the arm towards +y with 20 N
    ours = robot_state(state(wrench=vendor, tau_ext=np.full(7, -2.0)), 3.0)
    assert ours.wrench is not None
    np.testing.assert_array_equal(ours.wrench, [0.0, 20.0, 0.0, 0.0, 0.0, 4.0])
    np.testing.assert_array_equal(ours.tau_ext, np.full(7, 2.0))
    velocity = DecayingVelocity().begun(ours.wrench[:3]).velocity
    assert velocity[1] > 0.1
    assert velocity[0] == velocity[2] == 0.0


def test_six_zeros_are_no_estimate_and_five_are_one() -> None:
    assert robot_state(state(wrench=np.zeros(6)), 0.0).wrench is None
    assert robot_state(state(wrench=np.array([0, 0, 0, 0, 0, 1e-9])), 0.0).wrench is not None


def test_all_else_keeps_its_sign() -> None:
    vendor = state()
    ours = robot_state(vendor, 7.0)
    assert ours.stamp == 7.0
    for theirs, name in (("q", "q"), ("qd", "qd"), ("q_d", "q_commanded"), ("dq_d", "qd_commanded")):
        np.testing.assert_array_equal(getattr(vendor, theirs), getattr(ours, name))


@pytest.mark.parametrize("errors", [(), ("joint_reflex",), ("joint_reflex", "communication_constraints_violation")])
def test_a_state_is_the_same_in_another_process(errors: tuple[str, ...]) -> None:
    given = state(errors=errors, last_motion_errors=("power_limit_violation",), mode="user stopped")
    back = unpacked(packed(given))
    for name in FrankaState.__slots__:
        np.testing.assert_array_equal(getattr(back, name), getattr(given, name))


def test_error_names_are_found_in_what_the_libraries_print() -> None:
    text = 'Move command aborted: motion aborted by reflex! ["joint_reflex", "cartesian_reflex"] rate: 0.99 [x]'
    assert error_names(text) == ("joint_reflex", "cartesian_reflex")
    assert error_names("[]") == error_names("nothing") == ()
