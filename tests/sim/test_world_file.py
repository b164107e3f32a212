"""Worlds from MJCF files round the simulated arm: bodies that fall, what touches the arm, rays, and what is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.sim.ranging import NO_ERROR

from pretouch.errors import ParameterError
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sim.plant import Plant
from pretouch.sim.rays import cast, geoms_of
from pretouch.sim.scene import SceneSpec

World = Callable[..., Plant]
_FLOOR = '<geom name="floor" type="plane" size="0 0 1" pos="0 0 -0.75"/>'


@pytest.fixture
def world(panda_model: RobotModel, tmp_path: Path) -> World:
    """An arm in the world of a file, which holds some bodies and whatever stands beside its worldbody."""

    def make(bodies: str, beside: str = "") -> Plant:
        file = tmp_path / "world.xml"
        file.write_text(f"<mujoco>{beside}<worldbody>{bodies}</worldbody></mujoco>")
        return Plant(panda_model, SceneSpec(world=file), NO_ERROR, panda_model.description.q_ready.copy(), seed=0)

    return make


def test_a_free_body_falls_and_rests(world: World) -> None:
    # the names of the arm's are not taken
    cube = '<body name="panda_link0" pos="1 0.5 0"><freejoint/><geom type="box" size=".05 .05 .05" mass="2"/></body>'
    plant = world(_FLOOR + cube)
    height = plant.mj_data.qpos[9:10]
    plant.advance(0.3)
    # semi-implicit Euler: g dt^2 (1 + 2 + ... + n)
    assert height[0] == pytest.approx(-9.81e-6 * 300 * 301 / 2, abs=1e-9)
    plant.advance(2.0)
    assert height[0] == pytest.approx(-0.7, abs=1e-3)
    assert plant.mj_data.qvel[7:] == pytest.approx(np.zeros(6), abs=1e-3)
    assert plant.touching
    assert not plant.true_force.any()


def test_a_weight_on_the_wrist_is_felt_with_its_weight(world: World, panda_model: RobotModel) -> None:
    sliding = '<joint type="slide" axis="0 0 1"/><geom type="box" size=".05 .05 .02" mass="1.5"/>'
    plant = world(f'<body pos="0.3 0 0.9">{sliding}</body>')
    plant.advance(0.05)
    assert not plant.true_force.any()
    assert plant.mj_data.qvel[7] == pytest.approx(-9.81 * 0.05, rel=1e-6)
    plant.advance(2.0)
    assert plant.true_force[2] == pytest.approx(-1.5 * 9.81, rel=1e-3)
    expected = np.zeros(7)
    kin = panda_model.kinematics(plant.mj_data.qpos[:7])
    for one in plant.contact_forces():
        expected += panda_model.jacobian(kin, one.link, one.point)[:3].T @ one.force
    told = np.mean([(plant.advance(0.01), plant.read().tau_ext)[1] for _ in range(30)], axis=0)
    assert np.abs(expected).max() > 2.0
    np.testing.assert_allclose(told, expected, atol=1.0)


def test_the_arm_stands_where_the_file_has_its_base(world: World) -> None:
    box = '<body name="box" pos="1 0.6 0.7"><geom type="box" size=".1 .1 .1"/></body>'
    assert world(box).mj_data.body("world/box").xpos == pytest.approx([1.0, 0.6, 0.7])
    # turned to the left by 90 degrees: what is 0.6 m to the left of it in the world is before it
    data = world('<site name="base" pos="1 0 0.5" euler="0 0 90"/>' + box).mj_data
    assert data.body("world/box").xpos == pytest.approx([0.6, 0.0, 0.2])
    assert data.body("panda_link0").xpos == pytest.approx(np.zeros(3))


def test_the_physics_is_computed_as_the_arms_and_nothing_is_said_of_it(
    world: World, capfd: pytest.CaptureFixture[str]
) -> None:
    visual = '<visual><map znear="0.3"/><headlight ambient="1 1 1"/></visual><statistic extent="3"/>'
    key = '<keyframe><key name="home" qpos="0 0 1 1 0 0 0"/></keyframe>'
    settings = '<option timestep="0.01" integrator="RK4"/><size memory="1M" nuser_geom="2"/>'
    plant = world(_FLOOR + '<body><freejoint/><geom size=".1"/></body>', settings + visual + key)
    assert plant.mj_model.opt.timestep == 0.001
    assert plant.mj_model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert plant.mj_data.qpos[:7] == pytest.approx(plant.model.description.q_ready)
    assert capfd.readouterr().err == ""


_SHAPES = """
<asset>
  <mesh name="wedge" vertex="0 0 0  .3 0 0  0 .3 0  .3 .3 0  0 0 .2  .3 0 .2"/>
  <hfield name="hills" nrow="3" ncol="3" size=".5 .5 .2 .1" elevation="0 1 0 1 0 1 0 1 .5"/>
</asset>"""
_ROOM = (
    _FLOOR
    + """
<body pos=".6 .2 .1"><freejoint/><geom type="mesh" mesh="wedge" mass="1"/></body>
<geom type="hfield" hfield="hills" pos="-.5 .5 -.3"/>
<geom type="cylinder" size=".1 .2" pos="-.5 -.5 .3"/>
<geom type="ellipsoid" size=".1 .2 .3" pos=".5 -.5 .3"/>
<geom type="sphere" size=".05" pos=".4 .3 .4"/>
<body mocap="true" pos="0 -.7 .5"><geom type="box" size=".1 .1 .1"/></body>
"""
)


@pytest.mark.parametrize("farthest", [0.3, 1.3, 4.0])
def test_rays_meet_what_mujoco_finds_to_the_bit_anywhere_in_it(world: World, farthest: float) -> None:
    plant = world(_ROOM, _SHAPES)
    built, data, rng, cone = plant.mj_model, plant.mj_data, np.random.default_rng(0), cone_rays(2, PAPER_SENSOR.angle)
    geoms, met = geoms_of(built, data), set()
    hit, normal, geom = np.zeros(len(cone)), np.zeros((len(cone), 3)), np.zeros(len(cone), np.int32)
    for _ in range(1000):
        data.qpos[:7] = rng.uniform(plant.model.q_min, plant.model.q_max)
        data.qpos[10:14] = Rotation.random(rng=rng).as_quat()
        mujoco.mj_kinematics(built, data)
        # on a link's surface, inside it, a little away, or anywhere
        link = int(rng.integers(-1, len(plant.model.links)))
        origin = data.xpos[link] + rng.normal(0.0, 0.07, 3) if link >= 0 else rng.uniform(-1.0, 1.0, 3)
        rays = np.ascontiguousarray(cone @ Rotation.random(rng=rng).as_matrix().T)
        mujoco.mj_multiRay(
            built, data, origin, rays.reshape(-1), None, True, link, geom, hit, normal.reshape(-1), len(rays), farthest
        )
        distance, outwards, which = cast(origin, rays, geoms, link, farthest)
        within = (hit >= 0.0) & (hit <= farthest)
        assert np.array_equal(within, (distance >= 0.0) & (distance <= farthest))
        assert np.array_equal(distance[within], hit[within])
        assert np.array_equal(outwards[within], normal[within])
        assert np.array_equal(which[within], geom[within])
        met |= set(built.geom_type[which[within]].tolist())
    kinds = ("PLANE", "HFIELD", "CAPSULE", "SPHERE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
    assert met == {int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in kinds}


def test_what_is_transparent_is_not_met(world: World) -> None:
    plant = world(_FLOOR)
    origin, down = np.array([1.5, 0.0, 0.3]), np.array([[0.0, 0.0, -1.0]])
    assert cast(origin, down, geoms_of(plant.mj_model, plant.mj_data), -1, 4.0)[0] == pytest.approx([1.05])
    plant.mj_model.geom("world/floor").rgba[3] = 0.0
    assert cast(origin, down, geoms_of(plant.mj_model, plant.mj_data), -1, 4.0)[0] == [-1.0]


_HINGE = '<body name="door"><joint name="hinge"/><geom size=".1" mass="1"/>{}</body>'


@pytest.mark.parametrize(
    ("bodies", "beside", "words"),
    [
        (_HINGE.format(""), '<actuator><motor joint="hinge"/></actuator>', "has actuators, which are not simulated"),
        ("", '<option gravity="0 0 0"/>', r"has the option gravity \[0. 0. 0.\], and the arm's world has \[ 0.\s+0."),
        ("", '<option><flag contact="disable"/></option>', "has the option disableflags 16, and the arm's world has 0"),
        (
            '<site name="base" euler="0 3 0"/>',
            "",
            "moves or is tilted: the arm stands still, with gravity along",
        ),
        (_HINGE.format('<site name="base"/>'), "", "The site base of the scene .* moves or is tilted"),
        ('<geom type="mesh" mesh="nowhere"/>', "", "cannot be read as MJCF: .*nowhere"),
        ("<sphere/>", "", "cannot be read as MJCF: .*sphere"),
    ],
)
def test_what_cannot_be_used_is_named(world: World, bodies: str, beside: str, words: str) -> None:
    with pytest.raises(ParameterError, match=f"(?s){words}"):
        world(bodies, beside)


def test_a_file_that_is_not_there_is_named(panda_model: RobotModel, tmp_path: Path) -> None:
    scene: Any = SceneSpec(world=tmp_path / "none.xml")
    with pytest.raises(ParameterError, match=r"The scene .*none\.xml cannot be read"):
        Plant(panda_model, scene, NO_ERROR, panda_model.description.q_ready, seed=0)
