"""A load that a program announces: what it does to torques and force, what passes while it is awaited, and after."""

from dataclasses import replace

import numpy as np
import pytest
from tests.following_arm import DT, controller_of, on_its_way
from tests.recording.runs import Run, assert_replays

from pretouch.contact.announced_load import (
    announce,
    most_kg,
    store_free_torques,
    widen_for_load,
    without_load,
    wrench_of,
)
from pretouch.contact.residual_model import residual_init
from pretouch.errors import ParameterError
from pretouch.params import SequentialParams
from pretouch.profiles import PROFILES
from pretouch.types import Mode, Payload, RobotState

PRETOUCH = PROFILES["pretouch"]
STILL = np.zeros(7)


def robot(model, kg: float = 0.0, force: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> RobotState:
    """The ready arm at rest with a load at the end-effector's origin, and a force there."""
    q, (x, y, z) = model.description.q_ready, force
    wrench = np.array([x, y, z - 9.81 * kg, 0.0, 0.0, 0.0])
    return RobotState(0.0, q, STILL, q, STILL, model.ee_jacobian(model.kinematics(q)).T @ wrench, wrench)


def left(model, given: list[tuple[Payload | None, RobotState]]) -> list[RobotState]:
    """What is left of the arm's state after each step."""
    state, found, kin = None, [], model.kinematics(model.description.q_ready)
    for said, now in given:
        state = announce(state, said, now)
        if state is not None:
            now, state = without_load(state, model, kin, now, DT)
            state = store_free_torques(state, now.tau_ext, now.tau_ext)
        found.append(now)
    return found


def test_one_kilogram_pulls_the_joints_as_computed_by_hand(panda_model):
    """At q_ready the TCP is 0.3069 m before joint 1's axis; joint 2 is on it, at 0.333 m, joint 6 is 0.088 m behind."""
    x = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee][0]
    assert x == pytest.approx(0.3069, abs=1e-3)
    (state,) = left(panda_model, [(Payload(1.0, within_s=0.0), robot(panda_model))])
    np.testing.assert_allclose(-state.wrench, [0, 0, -9.81, 0, 0, 0], atol=1e-12)
    # joint 1 is vertical; joint 2 turns the hand down, so a weight turns it on; joint 6 is level, the lever is 0.088 m
    torque = -state.tau_ext
    np.testing.assert_allclose(torque[[0, 2, 4, 6]], 0.0, atol=1e-9)
    assert torque[1] == pytest.approx(9.81 * x, abs=1e-9)
    assert abs(torque[5]) == pytest.approx(9.81 * 0.088, abs=1e-3)


def test_a_centre_off_the_origin_has_moments_and_inertia(panda_model):
    R = np.diag([1.0, -1.0, -1.0])  # the hand points down: z of the hand is -z of the base
    wrench = wrench_of(Payload(2.0, (0.1, 0.0, 0.05)), R, np.array([0, 0, 9.81, 0, 0, 0]))
    np.testing.assert_allclose(wrench, [0, 0, -19.62, 0, 1.962, 0], atol=1e-12)
    # accelerated along x at 3 m/s^2, and about z at 4 rad/s^2 with a lever of 0.1 m along x: 0.4 m/s^2 along y
    force = wrench_of(Payload(2.0, (0.1, 0.0, 0.0)), R, np.array([3.0, 0, 9.81, 0, 0, 4.0]))[:3]
    np.testing.assert_allclose(force, [-6.0, -0.8, -19.62], atol=1e-12)


def test_the_torques_are_those_of_a_point_mass_by_its_own_jacobian(panda_model):
    q = panda_model.description.q_ready + 0.3 * np.random.default_rng(1).standard_normal(7)
    kin = panda_model.kinematics(q)
    payload = Payload(1.5, (0.05, -0.02, 0.1), within_s=0.0)
    state = RobotState(0.0, q, STILL, q, STILL, STILL, np.zeros(6))
    after, _ = without_load(announce(None, payload, state), panda_model, kin, state, DT)
    point = kin.position[panda_model.ee] + kin.rotation[panda_model.ee] @ payload.com_m
    J = panda_model.jacobian(kin, panda_model.ee, point)[:3]
    np.testing.assert_allclose(after.tau_ext, -J.T @ [0.0, 0.0, -9.81 * 1.5], atol=1e-12)


def test_a_load_that_is_swung_about_the_base_pulls_outwards(panda_model):
    """Joint 1 at 2 rad/s: m w^2 r, a little behind, as the observer is."""
    q, qd, state = panda_model.description.q_ready.copy(), np.array([2.0, 0, 0, 0, 0, 0, 0]), None
    for k in range(100):
        q[0] = 2.0 * DT * k
        now, kin = RobotState(DT * k, q, qd, q, qd, STILL, np.zeros(6)), panda_model.kinematics(q)
        after, state = without_load(
            announce(state, Payload(1.5, within_s=0.0), now), panda_model, kin, now, DT
        )  # fmt: skip
    out = kin.position[panda_model.ee] * [1.0, 1.0, 0.0]
    load, r = -after.wrench[:3], float(np.linalg.norm(out))
    assert load @ out / r == pytest.approx(1.5 * 2.0**2 * r, rel=0.01)
    assert load[2] == pytest.approx(-9.81 * 1.5)


@pytest.mark.parametrize("part", [0.0, 0.4, 1.0])
def test_any_part_of_the_change_passes_while_it_is_awaited_and_all_of_it_is_expected_after(panda_model, part):
    said, there = Payload(2.0, within_s=0.2), robot(panda_model, 2.0 * part)
    states = left(panda_model, [(said, there)] * 30)
    for state in states[:20]:
        np.testing.assert_allclose(state.tau_ext, 0.0, atol=1e-9)
        np.testing.assert_allclose(state.wrench, 0.0, atol=1e-9)
    np.testing.assert_allclose(states[-1].wrench[2], (1.0 - part) * 2.0 * 9.81, atol=1e-9)


def test_a_load_put_down_may_leave_bit_by_bit_too(panda_model):
    down = [(Payload(0.0), robot(panda_model, 2.0 * part)) for part in (1.0, 0.6, 0.0)]
    states = left(panda_model, [(Payload(2.0, within_s=0.0), robot(panda_model, 2.0))] * 3 + down)
    for state in states:
        np.testing.assert_allclose(state.wrench, 0.0, atol=1e-9)


def test_what_is_no_part_of_the_change_shows_meanwhile(panda_model):
    pushed = robot(panda_model, 1.0, (0.0, 15.0, 0.0))
    (state,) = left(panda_model, [(Payload(2.0), pushed)])
    assert state.wrench[1] == 15.0
    (lifted,) = left(panda_model, [(Payload(2.0), robot(panda_model, 0.0, (0.0, 0.0, 15.0)))])
    # from below, no part of a load: but for the tenth by which it may be wrong, all of the 15 N
    assert lifted.wrench[2] == pytest.approx(15.0 - 0.1 * 2.0 * 9.81)
    assert left(panda_model, [(Payload(2.0), robot(panda_model, 0.0, (0.0, 0.0, -40.0)))])[0].wrench[2] < -15.0


def test_without_torques_the_force_says_how_much_has_come(panda_model):
    blind = replace(robot(panda_model, 0.5), tau_ext=np.full(7, np.nan))
    (state,) = left(panda_model, [(Payload(2.0), blind)])
    assert np.isnan(state.tau_ext).all()
    np.testing.assert_allclose(state.wrench, 0.0, atol=1e-9)
    (none,) = left(panda_model, [(Payload(2.0), replace(blind, wrench=None))])
    assert none.wrench is None


def test_what_was_said_stays_and_saying_it_again_changes_nothing(panda_model):
    once, often = (announce(None, Payload(1.0), robot(panda_model)) for _ in range(2))
    assert announce(once, None, robot(panda_model)) is once
    assert announce(often, Payload(1.0), robot(panda_model)) is often
    assert announce(None, None, robot(panda_model)) is None
    changed = announce(replace(once, waited=3.0), Payload(0.0), robot(panda_model))
    assert (changed.before, changed.waited) == (Payload(1.0), 0.0)


def test_a_model_that_doubts_a_load_knows_its_other_weights_as_before():
    model = residual_init(7, SequentialParams())
    more = widen_for_load(model, 2.0).covariance - model.covariance
    expected = np.zeros_like(more)
    expected[:, -1, -1], expected[:, 0, 0] = 0.1**2, (2.0 * 9.81 * 0.02) ** 2
    np.testing.assert_allclose(more, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mass_kg": -0.1}, "Payload.mass_kg is -0.1: give 0 to 100"),
        ({"mass_kg": np.nan}, "Payload.mass_kg is nan"),
        ({"mass_kg": 700.0}, "Payload.mass_kg is 700.0"),
        ({"mass_kg": 1.0, "within_s": -1.0}, "Payload.within_s is -1.0: give 0 to 10"),
        ({"mass_kg": 1.0, "com_m": (0.0, 0.0, 50.0)}, "Payload.com_m is (0.0, 0.0, 50.0): give 0 to 2"),
        ({"mass_kg": 1.0, "com_m": (0.0, np.nan, 0.0)}, "Payload.com_m is"),
        ({"mass_kg": 1.0, "com_m": (0.0, 0.0)}, "com_m three of them"),
        ({"mass_kg": "much"}, "is no payload: give numbers"),
        ({"mass_kg": 1.0, "com_m": None}, "is no payload: give numbers"),
    ],
)
def test_nonsense_is_refused_with_a_sentence(given, said):
    with pytest.raises(ParameterError) as error:
        Payload(**given)
    assert said in str(error.value)


def test_an_array_is_taken_for_the_centre():
    assert Payload(1.0, np.array([0.0, 0.1, 0.2])) == Payload(1.0, (0.0, 0.1, 0.2))


@pytest.mark.parametrize(
    ("payload", "said"),
    [(Payload(40.0), "40 kg, more than the"), (0.7, "a float, no Payload")],
    ids=["heavy", "a number"],
)
def test_an_arm_holds_on_a_payload_it_cannot_carry_and_goes_on_without_it(panda_model, paper_skin, payload, said):
    arm = on_its_way(panda_model, paper_skin, PRETOUCH)

    step = arm.step(payload=payload)
    assert step.mode is Mode.HOLD
    assert said in step.reason
    assert arm.state.load is None
    assert arm.step().mode is Mode.TRACK


def test_a_panda_holds_less_than_its_joints_torques_allow(panda_model):
    """Joint 6, of 12 Nm, is 0.088 m from the hand's axis."""
    assert most_kg(panda_model) == pytest.approx(12.0 / (0.088 * 9.81), rel=1e-2)


def grips(k: int) -> Payload | None:
    """Something is gripped and put down; said once or in each step, or not at all."""
    if k < 100:
        return None
    return Payload(0.7, (0.0, 0.01, 0.05)) if k < 250 else Payload(0.0) if k == 250 else None


@pytest.mark.parametrize("name", ["pretouch", "paper"])
def test_a_run_with_a_payload_is_recorded_and_recomputed_bit_for_bit(panda_model, paper_skin, tmp_path, name):
    run = Run(controller_of(panda_model, paper_skin, PROFILES[name]), 2)
    # with snapshots of before, between and after
    recorded = assert_replays(run, tmp_path, lambda k, inputs: replace(inputs, payload=grips(k)), 700)
    assert recorded[699].inputs.payload is None
    assert run.state.load.payload == Payload(0.0)
