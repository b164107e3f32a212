"""What real arms do and the usual simulated one does not: friction that remembers, ringing, drift, cables, loads."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.sim.test_plant import PERFECT, record

from pretouch.errors import ParameterError
from pretouch.robot.model import RobotModel
from pretouch.sim.physics import BIAS, SPRING, begin_step, end_step
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.types import FloatArray

GRAVITY = 9.81


def plant(model: RobotModel, params: PlantParams) -> Plant:
    return Plant(model, SceneSpec(), params, model.description.q_ready, 1)


def at_rest(model: RobotModel, params: PlantParams) -> FloatArray:
    """Mean external torques (n,) of an arm that stands [Nm]."""
    return np.mean([state.tau_ext for state in record(plant(model, params), 1.0)[50:]], axis=0)


def lost(model: RobotModel, speeds: FloatArray, cold: float = 0.0, **errors: float) -> FloatArray:
    """Friction of a joint at some speeds one millisecond after the other, as it carries 5 Nm [Nm]."""
    arm, taken = plant(model, replace(PERFECT, **{"bristle_nm": 0.3} | errors))._arm, []
    arm.impedance[:], arm.state[BIAS], arm.cold[:] = 0.0, 5.0, cold
    for speed in speeds:
        arm.world.qd[:] = speed
        taken.append(begin_step(arm)[1][0])
    return np.array(taken)


def test_friction_remembers_where_a_joint_came_from_until_it_has_turned_far_enough(panda_model: RobotModel):
    forth, back = np.full(50, 0.5), np.full(50, -0.5)
    after = lost(panda_model, np.concatenate([forth, back, np.zeros(100)]))
    assert_allclose(after[49], 0.3, atol=1e-3)
    assert after[50] > 0.1  # half a milliradian back it still holds
    assert_allclose(after[99], -0.3, atol=1e-3)
    assert_allclose(after[100:], after[99])  # a joint at rest keeps what it has


@pytest.mark.parametrize(
    ("speed", "errors", "newton_metres"),
    [
        (0.002, {"stribeck": 0.5}, 0.3 * 1.5),
        (1.0, {"stribeck": 0.5}, 0.3),
        (1.0, {"cold": 0.5}, 0.45),
        (1.0, {"load_friction": 0.02}, 0.3 + 0.02 * 5.0),
    ],
)
def test_friction_is_larger_where_a_joint_barely_slides_under_load_and_in_the_cold(
    panda_model: RobotModel, speed, errors, newton_metres
):
    assert_allclose(lost(panda_model, np.full(int(40.0 / speed), speed), **errors)[-1], newton_metres, rtol=0.01)


@pytest.mark.parametrize("speed", [1e-6, 10.0, 1e4])
def test_bristles_stay_within_their_bounds_at_any_speed(panda_model: RobotModel, speed):
    found = lost(panda_model, np.tile([speed, -speed, -speed, speed], 300), stribeck=0.6)
    assert np.abs(found).max() <= 0.3 * 1.6 + 1e-12


def test_a_joint_on_a_spring_rings_at_its_frequency_and_settles_at_the_torque(panda_model: RobotModel):
    arm, none = plant(panda_model, replace(PERFECT, ring_hz=15.0, ring_damping=0.05))._arm, np.zeros(7)
    arm.world.qdd[:], arm.state[SPRING] = 0.0, 0.0
    rung = np.array([(end_step(arm, np.full(7, 2.0), none, none, none), arm.state[SPRING, 0])[1] for _ in range(3000)])
    assert rung.max() > 3.5  # a step overshoots by exp(-pi d): 0.85
    crossings = np.flatnonzero(np.diff(np.sign(rung[:400] - 2.0)))
    assert_allclose(np.diff(crossings).mean(), 1000 / 15 / 2, rtol=0.03)
    assert_allclose(rung[-1], 2.0, atol=1e-3)


def test_a_load_hangs_at_the_hand_from_when_it_is_gripped_until_it_is_put_down(panda_model: RobotModel):
    arm = plant(panda_model, replace(PERFECT, payload_kg=0.1))

    def pulled() -> float:
        return float(np.mean([state.wrench[2] for state in record(arm, 1.0)[50:] if state.wrench is not None]))

    assert_allclose(pulled(), -0.1 * GRAVITY, atol=0.1)
    arm.grip(0.7)
    assert_allclose(pulled(), -0.8 * GRAVITY, rtol=0.02)
    arm.grip(0.0)
    assert_allclose(pulled(), -0.1 * GRAVITY, atol=0.1)
    with pytest.raises(ParameterError, match="payload_kg above 0"):
        plant(panda_model, PERFECT).grip(0.5)


def test_a_cable_pulls_once_it_is_taut_and_hangs_before(panda_model: RobotModel):
    slack = replace(PERFECT, cable_n_m=25.0, cable_kg=0.2, cable_slack_m=0.5)
    ee = panda_model.ee_jacobian(panda_model.kinematics(panda_model.description.q_ready))[:3]
    assert_allclose(at_rest(panda_model, slack), ee.T @ [0.0, 0.0, -0.2 * GRAVITY], atol=0.05)
    taut = replace(slack, cable_slack_m=0.0001, cable_n_m=500.0)
    arm = plant(panda_model, taut)
    arm.command(np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0]))  # bends forward, away from the hook
    pulled = record(arm, 1.0)[-1]
    assert pulled.wrench is not None
    assert pulled.wrench[2] > 5.0


def test_offsets_wander_by_so_much_and_the_seed_says_how(panda_model: RobotModel):
    arm = plant(panda_model, replace(PERFECT, drift_nm=0.2, drift_s=0.05))
    seen = np.array([arm._err.copy() for _ in range(400) if arm.advance(0.01) is None])
    assert_allclose(seen.std(axis=0), 0.2, rtol=0.3)
    still = plant(panda_model, replace(PERFECT, drift_nm=0.2, drift_s=1e6))
    still.advance(1.0)
    assert np.abs(still._err).max() < 1e-3


def test_stamps_come_late_by_less_than_said_and_never_early(panda_model: RobotModel):
    states = record(plant(panda_model, replace(PERFECT, stamp_jitter_s=0.003)), 1.0)
    late = np.array([state.stamp - 0.01 * (k + 1) for k, state in enumerate(states)])
    assert late.min() >= -1e-9
    assert late.max() < 0.003
    assert np.ptp(late) > 0.002
