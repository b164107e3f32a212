"""What a page says of a step that a commander asked for."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch import desired
from pretouch.desired import Desired
from pretouch.explanation import Limit, explain
from pretouch.page.asked import Asked, asked_in, told
from pretouch.page.room import LiveSettings
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES
from pretouch.types import FloatArray


def shown(simulation: LiveSimulation, wanted: Desired | None) -> Asked | None:
    """What a page draws if something was asked in the newest step."""
    frame = simulation.frame
    assert frame.inputs is not None
    kin = simulation.model.kinematics(frame.step.q)
    return asked_in(replace(frame, inputs=replace(frame.inputs, desired=wanted)), simulation.world, kin)


@pytest.fixture(scope="module")
def simulation() -> LiveSimulation:
    simulation = LiveSimulation()
    simulation.advance(1.5)
    return simulation


def test_what_was_asked_is_drawn_as_a_velocity_and_where_it_leads(simulation: LiveSimulation) -> None:
    now, model = simulation.frame.step.stamp, simulation.model
    here = simulation.frame.step.ee_position
    kin = model.kinematics(simulation.frame.step.q)
    twist = shown(simulation, desired.twist(now, (0.1, 0.0, -0.2)))
    assert twist
    assert twist.velocity.tolist() == [0.1, 0.0, -0.2]
    assert twist.goal is None
    np.testing.assert_allclose(twist.allowed, model.ee_jacobian(kin)[:3] @ simulation.frame.step.command)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = kin.rotation[model.ee], here + np.array([0.0, 0.05, 0.0])
    pose = shown(simulation, desired.pose(now, T))
    assert pose
    np.testing.assert_allclose(pose.velocity, [0.0, 0.1, 0.0], atol=1e-12)  # 2 1/s times 5 cm
    np.testing.assert_array_equal(pose.goal, T)
    q = simulation.frame.step.q_commanded
    joints = shown(simulation, desired.joint_positions(now, q))
    assert joints
    np.testing.assert_allclose(joints.velocity, 0.0, atol=1e-12)
    assert joints.goal is not None
    np.testing.assert_allclose(joints.goal[:3, 3], model.kinematics(q).position[model.ee])


def test_nothing_is_drawn_of_what_nobody_asked_or_nobody_can_use(simulation: LiveSimulation) -> None:
    now = simulation.frame.step.stamp
    for wanted in (None, desired.twist(now, (np.nan, 0.0, 0.0)), desired.joint_velocities(now, np.zeros(3))):
        assert shown(simulation, wanted) is None
    kin = simulation.model.kinematics(simulation.frame.step.q)
    assert asked_in(replace(simulation.frame, inputs=None), simulation.world, kin) is None


def approaching(place: FloatArray, wanted: FloatArray) -> tuple[LiveSimulation, str]:
    """A driven arm with the person's hand at a place (3,) [m] beside its own; what is said after two seconds."""
    simulation = LiveSimulation()
    simulation.commander = lambda now: desired.twist(now, np.zeros(3))
    simulation.advance(1.5)
    simulation.move_hand(simulation.frame.step.ee_position + place)
    simulation.advance(2.0)
    simulation.commander = lambda now: desired.twist(now, wanted)
    simulation.advance(0.6)
    step = simulation.frame.step
    asked = asked_in(simulation.frame, simulation.world, simulation.model.kinematics(step.q))
    found = told(asked, step, simulation.skin.ids, simulation.model.links)
    assert found.sentence.startswith(explain(step, simulation.skin.ids, simulation.model.links).sentence)
    return simulation, found.sentence


def test_the_sentence_names_unit_and_link_that_limit_what_is_asked() -> None:
    simulation, said = approaching(np.array([0.0, 0.42, 0.05]), np.array([0.0, 0.3, 0.0]))
    limited = simulation.frame.step.limited
    assert simulation.skin.ids[limited.unit] == "hand_left"
    assert "Asked 0.30 m/s, allowed 0." in said
    assert said.endswith(" what hand_left sees near panda_hand.")


def test_an_arm_at_the_end_of_its_reach_and_one_without_units_say_what_limits_them(simulation: LiveSimulation) -> None:
    step, way = simulation.frame.step, np.array([0.0, 0.2, 0.0])
    assert step.limited.by is Limit.NOTHING
    asked, links = Asked(way, 0.5 * way, None), simulation.model.links
    said = told(asked, step, simulation.skin.ids, links).sentence
    assert said.endswith(" Asked 0.20 m/s, allowed 0.10 m/s: this posture allows no more.")
    said = told(asked, replace(step, speed_scale=0.5), (), links).sentence
    assert said.endswith(" Asked 0.20 m/s, allowed 0.10 m/s: slowed.")


def test_the_page_of_a_blind_arm_knows_no_unit_in_use() -> None:
    simulation = LiveSimulation(LiveSettings(profile=PROFILES["blind"]))
    simulation.advance(1.5)
    found = told(None, simulation.frame.step, simulation.world.units_in_use, simulation.model.links)
    assert found.sentence.endswith(": no sensor unit is in use.")
    assert LiveSimulation().world.units_in_use == simulation.skin.ids


def test_what_is_allowed_in_full_needs_no_reason_and_rest_is_named() -> None:
    assert approaching(np.array([0.5, 0.5, 0.5]), np.array([0.0, -0.1, 0.0]))[1].endswith("allowed 0.10 m/s.")
    assert approaching(np.array([0.5, 0.5, 0.5]), np.zeros(3))[1].endswith(" No motion is asked.")
