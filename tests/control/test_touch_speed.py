"""The touch speed by numbers, and the mass along a direction against MuJoCo's own inverse."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.cholesky import factor
from pretouch.control.braking import TouchLimits, braking_numbers, mass_along, touch_speed
from pretouch.params.pretouch import REGIONS, BrakingParams, EffectiveMass
from pretouch.robot.model import RobotModel

UNCAPPED = 100.0


def limits(mass: EffectiveMass, fastest: float) -> TouchLimits:
    return braking_numbers(BrakingParams(touch_speed_max_m_s=fastest, effective_mass=mass), 0.3, 0.01).touch


def speed(region: str, mass: float, fraction: float = 1.0, force: float = 0.0) -> float:
    felt = EffectiveMass(body_region=region, force_fraction=fraction, region_force_n=force)  # type: ignore[arg-type]
    return touch_speed(
        mass, braking_numbers(BrakingParams(touch_speed_max_m_s=UNCAPPED, effective_mass=felt), 0.3, 0.01).touch
    )


def test_the_spring_model_by_numbers():
    # chest: F = 2 * 140 N, k = 25 N/mm; m_R = 10 kg: mu = 40 * 10 / 50 = 8 kg, sqrt(mu k) = 447.2136 N s/m
    assert speed("chest", 10.0) == pytest.approx(280.0 / 447.2135955)
    # hand against an arm that cannot move: mu = 0.6 kg, sqrt(0.6 * 75000) = 212.1320
    assert speed("hand", np.inf) == pytest.approx(280.0 / 212.1320344)
    # a quarter of a force of one's own, 100 N
    assert speed("chest", 10.0, fraction=0.25, force=100.0) == pytest.approx(25.0 / 447.2135955)


def test_face_and_skull_are_allowed_no_more_for_a_short_contact():
    # mu = 4.4 / 2 = 2.2 kg
    assert speed("face", 4.4) == pytest.approx(65.0 / np.sqrt(2.2 * 75_000.0))
    assert speed("skull", 4.4) == pytest.approx(130.0 / np.sqrt(2.2 * 150_000.0))


def test_field_notes_example_comes_back_as_the_force_of_its_speed():
    # 0.3 m/s and m_R 8.9 kg: 62 N on a hand, 128 N on a chest, 141 N on a face
    for region, force in {"hand": 62.0, "chest": 128.0, "face": 141.0}.items():
        assert speed(region, 8.9, force=force) == pytest.approx(0.3, rel=0.01)


def test_the_cap_holds_whatever_the_mass():
    params = limits(EffectiveMass("abdomen"), 0.05)
    assert touch_speed(1e-3, params) == 0.05
    assert touch_speed(np.inf, params) <= 0.05


@given(st.sampled_from(sorted(REGIONS)), st.floats(0.01, 1e3), st.floats(0.01, 1e3))
def test_a_heavier_arm_may_touch_no_faster(region, one, other):
    lighter, heavier = sorted((one, other))
    assert speed(region, heavier) <= speed(region, lighter)


def test_the_mass_along_a_direction_is_that_of_mujoco(panda_model: RobotModel):
    rng = np.random.default_rng(1000)
    mj = mujoco.MjModel.from_xml_path(str(panda_model.description.mjcf))
    mj.dof_armature[:] = 0.1
    data, L = mujoco.MjData(mj), np.empty((7, 7))
    for _ in range(20):
        q = rng.uniform(panda_model.q_min, panda_model.q_max)
        link = int(rng.integers(3, panda_model.ee + 1))
        kin = panda_model.kinematics(q)
        point, normal = kin.position[link] + rng.uniform(-0.1, 0.1, 3), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        data.qpos[:] = q
        mujoco.mj_forward(mj, data)
        J, solved = np.zeros((3, 7)), np.zeros((1, 7))
        mujoco.mj_jac(mj, data, J, None, point, link)
        row = normal @ J
        mujoco.mj_solveM(mj, data, solved, row[None])
        assert factor(panda_model.mass_matrix(q) + 0.1 * np.eye(7), L)
        assert mass_along(L, row) == pytest.approx(1.0 / float(solved[0] @ row), rel=1e-9)


def test_a_point_that_cannot_move_has_infinite_mass(panda_model: RobotModel):
    L = np.empty((7, 7))
    assert factor(panda_model.mass_matrix(panda_model.description.q_ready), L)
    assert mass_along(L, np.zeros(7)) == np.inf
