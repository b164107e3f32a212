"""What a page shows, and says, of a step that a commander asked for."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch import desired
from pretouch.desired import Desired
from pretouch.explanation import Limit, explain
from pretouch.page.frame import DrivenMotion, driven_motion
from pretouch.page.room import LiveSettings
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES
from pretouch.types import FloatArray


def drawn(simulation: LiveSimulation, motion: Desired | None) -> DrivenMotion | None:
    """What a page draws if something was asked in the newest step."""
    frame = simulation.frame
    assert frame.inputs is not None
    kin = simulation.model.kinematics(frame.step.q)
    return driven_motion(replace(frame, inputs=replace(frame.inputs, desired=motion)), simulation.world, kin)


@pytest.fixture(scope="module")
def simulation():
    simulation = LiveSimulation()
    simulation.advance(1.5)
    return simulation


def test_what_was_asked_is_drawn_as_a_velocity_and_where_it_leads(simulation):
    now, model = simulation.frame.step.stamp, simulation.model
    here = simulation.frame.step.ee_position
    kin = model.kinematics(simulation.frame.step.q)
    twist = drawn(simulation, desired.twist(now, (0.1, 0.0, -0.2)))
    assert twist
    assert twist.velocities[0].tolist() == [0.1, 0.0, -0.2]
    assert twist.goal is None
    np.testing.assert_allclose(twist.velocities[1], model.ee_jacobian(kin)[:3] @ simulation.frame.step.command)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = kin.rotation[model.ee], here + np.array([0.0, 0.05, 0.0])
    pose = drawn(simulation, desired.pose(now, T))
    assert pose
    np.testing.assert_allclose(pose.velocities[0], [0.0, 0.1, 0.0], atol=1e-12)  # 2 1/s times 5 cm
    np.testing.assert_array_equal(pose.goal, T)
    q = simulation.frame.step.q_commanded
    joints = drawn(simulation, desired.joint_positions(now, q))
    assert joints
    np.testing.assert_allclose(joints.velocities[0], 0.0, atol=1e-12)
    assert joints.goal is not None
    np.testing.assert_allclose(joints.goal[:3, 3], model.kinematics(q).position[model.ee])


def test_nothing_is_drawn_of_what_nobody_asked_or_nobody_can_use(simulation):
    now = simulation.frame.step.stamp
    for motion in (None, desired.twist(now, (np.nan, 0.0, 0.0)), desired.joint_velocities(now, np.zeros(3))):
        assert drawn(simulation, motion) is None
    kin = simulation.model.kinematics(simulation.frame.step.q)
    assert driven_motion(replace(simulation.frame, inputs=None), simulation.world, kin) is None


def approaching(place: FloatArray, velocity: FloatArray) -> tuple[LiveSimulation, str]:
    """A driven arm with the person's hand at a place (3,) [m] beside its own; what is said after two seconds."""
    simulation = LiveSimulation()
    simulation.commander = lambda now: desired.twist(now, np.zeros(3))
    simulation.advance(1.5)
    simulation.move_hand(simulation.frame.step.ee_position + place)
    simulation.advance(2.0)
    simulation.commander = lambda now: desired.twist(now, velocity)
    simulation.advance(0.6)
    step, names = simulation.frame.step, (simulation.skin.ids, simulation.model.links)
    motion = driven_motion(simulation.frame, simulation.world, simulation.model.kinematics(step.q))
    assert motion
    sentence = explain(step, *names, motion.velocities).sentence
    assert sentence.startswith(explain(step, *names).sentence)
    return simulation, sentence


def test_the_sentence_names_unit_and_link_that_limit_what_is_asked():
    simulation, sentence = approaching(np.array([0.0, 0.42, 0.05]), np.array([0.0, 0.3, 0.0]))
    assert simulation.skin.ids[simulation.frame.step.limited.unit] == "hand_left"
    assert "hand_left sees something at 0." in sentence
    assert "Requested 0.30 m/s, allowed 0." in sentence
    assert sentence.endswith(" m/s near panda_hand.")


def test_an_arm_at_the_end_of_its_reach_one_at_a_joint_limit_and_one_without_units_say_what_limits_them(simulation):
    step, way, links = simulation.frame.step, np.array([0.0, 0.2, 0.0]), simulation.model.links
    assert step.limited.by is Limit.NOTHING
    halved = " Requested 0.20 m/s, allowed 0.10 m/s"
    sentence = explain(step, simulation.skin.ids, links, (way, 0.5 * way)).sentence
    assert sentence.endswith(f"{halved}: this posture allows no more.")
    qp = replace(step.qp, multipliers=np.eye(len(step.qp.multipliers))[3])
    sentence = explain(replace(step, qp=qp), simulation.skin.ids, links, (way, 0.5 * way)).sentence
    assert sentence.endswith(f"{halved}: joint 4 is at its limit.")
    sentence = explain(replace(step, speed_scale=0.5), (), links, (way, 0.5 * way)).sentence
    assert sentence.startswith("Slowed to 50 %: ")
    assert sentence.endswith(f"{halved}.")


def test_the_page_of_a_blind_arm_knows_no_unit_in_use():
    world = LiveSimulation(LiveSettings(profile=PROFILES["blind"])).world
    assert world.units_in_use == ()
    assert LiveSimulation().world.units_in_use == world.skin.ids


def test_what_is_allowed_in_full_needs_no_reason_and_rest_is_named():
    assert approaching(np.array([0.5, 0.5, 0.5]), np.array([0.0, -0.1, 0.0]))[1].endswith("allowed 0.10 m/s.")
    assert approaching(np.array([0.5, 0.5, 0.5]), np.zeros(3))[1].endswith(" No motion is requested.")
