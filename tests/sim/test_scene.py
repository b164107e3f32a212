import mujoco
import numpy as np
import pytest

from pretouch.robot.model import RobotModel
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import ArmError, Box, HandSpec, SceneSpec, build, fixtures
from pretouch.types import FloatArray

BELOW = np.array([0.0, 0.0, 1.0])
"""A push upwards, against the tip of the closed fingers, which point straight down in the ready posture."""
TIP = 0.0087
"""From the TCP to the tip of the finger capsule [m]."""


def nominal(model: RobotModel, payload: float = 0.0) -> ArmError:
    return ArmError(PlantParams(), np.ones(len(model.links)), payload)


def fingertip(model: RobotModel) -> FloatArray:
    return model.kinematics(model.description.q_ready).position[model.ee] - TIP * BELOW


def names(built: mujoco.MjModel, data: mujoco.MjData, contact: int) -> set[str]:
    return {built.geom(geom).name for geom in (data.contact[contact].geom1, data.contact[contact].geom2)}


def held(built: mujoco.MjModel, model: RobotModel) -> mujoco.MjData:
    """All of a scene held still, the arm ready, by the forces that it takes, contact forces included."""
    data = mujoco.MjData(built)
    data.qpos[: model.n] = model.description.q_ready
    mujoco.mj_inverse(built, data)
    data.qfrc_applied[:] = data.qfrc_inverse
    mujoco.mj_forward(built, data)
    return data


def normal_force(built: mujoco.MjModel, data: mujoco.MjData, contact: int) -> float:
    wrench = np.zeros(6)
    mujoco.mj_contactForce(built, data, contact, wrench)
    return float(wrench[0])


@pytest.mark.parametrize("capsule", [*(f"link{i}_1" for i in range(8)), "hand_2", "floor", "block", "pedestal"])
def test_a_hand_held_in_anything_feels_its_own_stiffness(panda_model, capsule):
    block = Box("block", (1.0, 0.0, 0.5), (0.1, 0.1, 0.1), 40_000.0)
    bare = build(panda_model, SceneSpec(boxes=(block,)), nominal(panda_model))
    data = mujoco.MjData(bare)
    data.qpos[:] = panda_model.description.q_ready
    mujoco.mj_forward(bare, data)
    geom, away = bare.geom(capsule).id, data.geom(capsule).xmat.reshape(3, 3)[:, 0]
    out = {"floor": 0.0, "block": 0.1}.get(capsule, float(bare.geom_size[geom, 0]))
    if capsule == "floor":
        away = np.array([0.0, 0.0, 1.0])
    start = data.geom(capsule).xpos + (out + HandSpec.radius - 1e-3) * away
    built = build(panda_model, SceneSpec(boxes=(block,), hand=HandSpec(start=tuple(start))), nominal(panda_model))
    data = held(built, panda_model)
    (touching,) = [c for c in range(data.ncon) if names(built, data, c) == {"hand", capsule}]
    assert normal_force(built, data, touching) == pytest.approx(75_000.0 * 1e-3, rel=0.02)


@pytest.mark.parametrize("penetration", [1e-4, 1e-3, 3e-3])
@pytest.mark.parametrize(("thing", "stiffness"), [("plate", 40_000.0), ("floor", 100_000.0)])
def test_a_body_held_in_an_object_feels_stiffness_times_penetration(panda_model, thing, stiffness, penetration):
    top = float(fingertip(panda_model)[2]) + penetration
    plate = Box("plate", (0.3, 0.0, top - 0.05), (0.2, 0.2, 0.05), 40_000.0)
    spec = SceneSpec(boxes=(plate,)) if thing == "plate" else SceneSpec(floor_height=top)
    built = build(panda_model, spec, nominal(panda_model, payload=0.1))
    data = held(built, panda_model)
    touching = [c for c in range(data.ncon) if names(built, data, c) == {"hand_2", thing}]
    assert len(touching) == 1
    assert normal_force(built, data, touching[0]) == pytest.approx(stiffness * penetration, rel=0.02)


def impact_peak(model: RobotModel, damping_ratio: float, period: float) -> float:
    """Largest force [N] as a free hand at 0.3 m/s hits an arm whose motors only carry its weight."""
    start = fingertip(model) - (HandSpec().radius + 1e-4) * BELOW
    spec = SceneSpec(hand=HandSpec(start=tuple(start)), damping_ratio=damping_ratio)
    built = build(model, spec, nominal(model))
    built.opt.timestep = period
    data = mujoco.MjData(built)
    data.qpos[: model.n] = model.description.q_ready
    data.qvel[model.n :] = 0.3 * BELOW
    peak = 0.0
    while data.time < 0.03:
        mujoco.mj_step1(built, data)
        data.qfrc_applied[: model.n] = data.qfrc_bias[: model.n]
        mujoco.mj_step2(built, data)
        peak = max([peak, *(normal_force(built, data, c) for c in range(data.ncon))])
    assert data.qvel[-1] < 0, "the hand has not bounced off"
    return peak


def reduced_mass(model: RobotModel) -> float:
    """Mass of the oscillator that a 0.6 kg hand and the arm make at the fingertip [kg]."""
    q = model.description.q_ready
    J = BELOW @ model.jacobian(model.kinematics(q), model.ee, fingertip(model))[:3]
    M = model.mass_matrix(q) + 0.1 * np.eye(model.n)
    return float(1.0 / (1.0 / 0.6 + J @ np.linalg.solve(M, J)))


@pytest.mark.parametrize(("ratio", "period", "peak"), [(0.0, 1e-3, 59.8), (0.0, 1e-4, 59.8), (0.1, 1e-4, 49.2)])
def test_an_impact_peaks_as_a_mass_on_a_spring_and_a_damper(panda_model, ratio, period, peak):
    mu, k, v = reduced_mass(panda_model), 75_000.0, 0.3
    b = ratio * 2.0 * np.sqrt(k * 2.0)  # as a part of critical for 2 kg
    omega, zeta = np.sqrt(k / mu), b / (2.0 * np.sqrt(k * mu))
    t = np.linspace(0.0, np.pi / omega, 10_001)
    ring = omega * np.sqrt(1.0 - zeta**2)
    depth = v / ring * np.exp(-zeta * omega * t) * np.sin(ring * t)
    expected = np.max(k * depth + b * np.gradient(depth, t))
    assert expected == pytest.approx(peak, abs=0.1)
    assert impact_peak(panda_model, ratio, period) == pytest.approx(expected, rel=0.03)


def test_only_declared_pairs_touch(panda_model):
    inside = SceneSpec(boxes=(Box("block", (1.0, 0.0, 0.0), (0.2, 0.2, 0.4), 1e4),), hand=HandSpec(start=(1.0, 0, 0)))
    data = mujoco.MjData(built := build(panda_model, inside, nominal(panda_model)))
    mujoco.mj_forward(built, data)
    # block and floor overlap as well, and neighbouring links do
    assert [names(built, data, c) for c in range(data.ncon)] == [{"block", "hand"}]
    data.qpos[7:] = [0.0, -2.0, 0.0]
    data.qpos[:7] = [0.0, 1.6, 0.0, -0.07, 0.0, 1.6, 0.0]
    mujoco.mj_forward(built, data)
    pairs = [names(built, data, c) for c in range(data.ncon)]
    assert pairs
    assert all(len(pair & {"block", "floor", "hand"}) == 1 for pair in pairs)


def test_the_arm_differs_from_its_model_as_asked(panda_model):
    factor = np.linspace(0.96, 1.04, len(panda_model.links))
    built = build(panda_model, SceneSpec(), ArmError(PlantParams(armature_kg_m2=0.12), factor, payload=0.07))
    plain = mujoco.MjModel.from_xml_path(str(panda_model.description.mjcf))
    links = len(panda_model.links)
    assert built.body_mass[:links] == pytest.approx(factor * plain.body_mass)
    assert built.body_inertia[:links] == pytest.approx(factor[:, None] * plain.body_inertia)
    assert built.body("payload").mass == pytest.approx(0.07)
    assert built.body_parentid[built.body("payload").id] == panda_model.ee
    assert built.dof_armature == pytest.approx(np.full(7, 0.12))
    assert not built.dof_damping.any()
    assert built.nu == 0


@pytest.mark.parametrize(("height", "radius"), [(-0.2, 0.1), (-0.45, 0.15)])
def test_the_declared_fixtures_are_those_that_were_built(panda_model, height, radius):
    spec = SceneSpec(floor_height=height, pedestal_radius=radius)
    declared, built = fixtures(spec), build(panda_model, spec, nominal(panda_model))
    floor, pedestal = built.geom("floor"), built.geom("pedestal")
    assert declared.planes == pytest.approx(np.array([[0.0, 0.0, 1.0, floor.pos[2]]]))
    assert declared.capsules.radius == pytest.approx([pedestal.size[0]])
    ends = [pedestal.pos[2] - pedestal.size[1], pedestal.pos[2] + pedestal.size[1]]
    assert sorted([declared.capsules.a[0, 2], declared.capsules.b[0, 2]]) == pytest.approx(ends)
    assert ends[1] + radius == pytest.approx(0.0), "the pedestal carries the base"
