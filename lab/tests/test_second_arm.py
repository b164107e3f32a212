"""Two arms in one world: each as if it were alone while they are apart, and both feel the same touch."""

from pathlib import Path

import numpy as np
import pytest
from tests.sim.ranging import EXACT, FORWARD, NO_ERROR, ORIGIN

from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import BasePose, HandSpec, SceneSpec
from pretouch_lab.second_arm import SecondArm

APART_M = 1.0


def facing(model: RobotModel, apart: float, params: PlantParams = NO_ERROR) -> tuple[Plant, SecondArm]:
    """Two arms in the ready posture that look at each other, and a person's hand out of the way."""
    q = model.description.q_ready
    second = SecondArm(model, BasePose((apart, 0.0, 0.0), np.pi), params, 1)
    first = Plant(model, SceneSpec(hand=HandSpec(start=(0.0, 2.0, 0.5)), second=second.spec), params, q, 0)
    second.join(first, q)
    return first, second


def test_the_links_stand_where_the_base_says(panda_model):
    # x of the second arm is y of the first
    T = BasePose((1.2, 0.3, 0.1), np.pi / 2).T
    assert pytest.approx([1.2, 0.4, 0.6, 1.0]) == T @ [0.1, 0.0, 0.5, 1.0]
    _, second = facing(panda_model, APART_M)
    kin, links = panda_model.kinematics(panda_model.description.q_ready), len(panda_model.links)
    x, y, z = kin.position[1:].T
    # turned by half a turn about z
    assert second.link_position[1:links] == pytest.approx(np.column_stack([APART_M - x, -y, z]))


def test_the_units_of_each_see_the_hand_of_the_other(panda_model):
    first, second = facing(panda_model, APART_M)
    skin = Skin([SensorUnit("ahead", "panda_hand", FORWARD)], panda_model)
    finders = [RangeFinders(arm, skin, RangeFinderParams(**EXACT), 3) for arm in (first, second)]
    first.advance(0.2)
    second.read()
    # both units sit on the front of a hand, as far from their own base: what is left of the way is between them
    for own in finders:
        assert own.read().distance[0] == pytest.approx(APART_M - 2 * ORIGIN[0], abs=0.01)


def test_out_of_reach_a_second_arm_is_an_arm_alone(panda_model):
    q, qd = panda_model.description.q_ready, 0.1 * np.ones(7)
    params = PlantParams(state_delay_s=0.003, command_delay_s=0.004)
    alone, (first, second) = Plant(panda_model, SceneSpec(), params, q, 1), facing(panda_model, 2.5, params)
    for _ in range(100):
        alone.command(qd)
        second.command(qd)
        alone.advance(0.01)
        first.advance(0.01)
        one, other = alone.read(), second.read()
        assert other.stamp == one.stamp
        assert other.q == pytest.approx(one.q, abs=1e-6)
        assert other.tau_ext == pytest.approx(one.tau_ext, abs=1e-3)
    assert np.abs(one.q - q).min() > 0.05
    assert not second.touches


def test_both_feel_the_same_touch(panda_model):
    first, second = facing(panda_model, 0.75)
    jacobian = panda_model.ee_jacobian(panda_model.kinematics(panda_model.description.q_ready))
    ahead = np.linalg.pinv(jacobian) @ [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    for _ in range(150):
        first.command(ahead)
        second.command(ahead)
        first.advance(0.01)
        second.read()
        assert second.true_force == pytest.approx(-first.true_force)
        if first.true_force[0] < -5.0:
            break
    # each was pushed back, along its own x axis
    assert first.true_force[0] < -5.0
    assert first.touches
    assert second.touches
    assert second.touches[0].velocity[0] > 0.05
    assert {force.link for force in second.contact_forces()} <= set(range(1, len(panda_model.links)))
    first.advance(0.05)
    assert first.read().wrench[0] < -2.0
    assert second.read().wrench[0] < -2.0


def test_a_second_arm_is_found_beside_a_free_body(panda_model: RobotModel, tmp_path: Path):
    file, q = tmp_path / "world.xml", panda_model.description.q_ready
    file.write_text('<mujoco><worldbody><body pos="0 2 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>')
    second = SecondArm(panda_model, BasePose((1.0, 0.0, 0.0), np.pi), NO_ERROR, seed=1)
    plant = Plant(panda_model, SceneSpec(second=second.spec, world=file), NO_ERROR, q, seed=0)
    second.join(plant, q)
    plant.advance(0.2)
    assert second.read().q == pytest.approx(q, abs=1e-2)
    assert plant.mj_data.qpos[-5] == pytest.approx(-9.81e-6 * 200 * 201 / 2, abs=1e-6)
