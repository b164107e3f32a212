"""The arm is slow towards where no unit looks, and as fast as is asked where they see all that it meets."""

from dataclasses import replace

import numpy as np
import pytest
from tests.following_arm import Arm

from pretouch.desired import joint_velocities
from pretouch.errors import ParameterError
from pretouch.params import PerceptionParams, UnseenSpeed
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.perception.unseen import unseen_on, unseen_scale
from pretouch.profiles import PROFILES, profile
from pretouch.robot.body import no_capsules
from pretouch.sensing.sensor import Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import Inputs

SPEED = UnseenSpeed().speed_m_s
SIGHT = PerceptionParams()
ALONG = np.array([0.0, 0.3, 0.0])


def scale_of(model, skin, velocity=ALONG, qd=None, fixtures=None, sight=SIGHT, q=None, **params):
    """Factor on what is asked, in the ready posture unless another is given."""
    bound = unseen_on(UnseenSpeed(**params), model, skin, fixtures or no_fixtures(), sight)
    return unseen_scale(bound, model.kinematics(model.description.q_ready if q is None else q), velocity, qd)


def fastest_onto(model, qd):
    """Largest n . v [m/s] of the whole surface, by differences of two postures."""
    q, places, dt = model.description.q_ready, model.surface, 1e-6
    at = [model.kinematics(q + sign * dt * qd) for sign in (-1, 1)]
    point = [k.position[places.link] + np.einsum("pij,pj->pi", k.rotation[places.link], places.point) for k in at]
    normal = np.einsum("pij,pj->pi", model.kinematics(q).rotation[places.link], places.normal)
    return (((point[1] - point[0]) / (2 * dt)) * normal).sum(axis=1).max()


def looking_about(model, sensor):
    """Twelve units in a ring about the hand that look away from it."""
    hand = model.links[model.ee]
    poses = []
    for turn in np.arange(0.0, 2 * np.pi, np.pi / 6):
        z = np.array([np.cos(turn), np.sin(turn), 0.0])
        T = np.eye(4)
        T[:3, 2], T[:3, 0] = z, np.cross([0.0, 0.0, 1.0], z)
        T[:3, 1], T[:3, 3] = np.cross(z, T[:3, 0]), 0.11 * z
        poses.append(T)
    return Skin([SensorUnit(f"u{i}", hand, T, sensor=sensor) for i, T in enumerate(poses)], model)


def test_without_a_unit_the_fastest_place_is_as_fast_as_is_allowed(panda_model):
    qd = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = scale_of(panda_model, Skin((), panda_model), qd=qd, velocity=np.zeros(3))
    # places of the bound lie 50 mm apart, those here 25 mm
    assert found * fastest_onto(panda_model, qd) == pytest.approx(SPEED, rel=0.05)


def test_a_velocity_of_the_hand_is_bounded_as_the_joint_velocities_for_it(panda_model):
    J = panda_model.ee_jacobian(panda_model.kinematics(panda_model.description.q_ready))
    qd = np.linalg.pinv(J) @ np.concatenate([ALONG, np.zeros(3)])
    nothing = Skin((), panda_model)
    assert scale_of(panda_model, nothing) == pytest.approx(scale_of(panda_model, nothing, qd=qd), rel=1e-2)


@pytest.mark.parametrize("speed", [0.0, 0.02, 0.09])
def test_a_slow_arm_is_left_as_it_is(panda_model, speed):
    assert scale_of(panda_model, Skin((), panda_model), velocity=np.array([0.0, speed, 0.0])) == 1.0


def test_without_perception_units_see_nothing(panda_model, paper_skin):
    nothing = scale_of(panda_model, Skin((), panda_model))
    assert scale_of(panda_model, paper_skin, sight=None) == nothing < scale_of(panda_model, paper_skin)


def test_units_that_see_what_the_hand_meets_leave_it_fast(panda_model):
    few, zones = (looking_about(panda_model, Sensor.called(name)()) for name in ("vl53l1x", "vl53l7cx"))
    turning = {"velocity": np.zeros(3), "qd": 4.0 * np.eye(7)[6]}
    alone = scale_of(panda_model, Skin((), panda_model), **turning)
    assert alone < scale_of(panda_model, few, **turning) < scale_of(panda_model, zones, **turning)


def test_one_more_unit_never_slows(panda_model):
    whole = looking_about(panda_model, Sensor.called("vl53l5cx")())
    found = [scale_of(panda_model, Skin(whole.mounted[:count], panda_model)) for count in range(len(whole.mounted) + 1)]
    assert np.all(np.diff(found) >= 0.0)


def test_what_stands_before_a_unit_hides_what_is_behind_it(panda_model):
    zones, turning = looking_about(panda_model, Sensor.called("vl53l7cx")()), 4.0 * np.eye(7)[6]
    clear = scale_of(panda_model, zones, qd=turning)
    hand = panda_model.kinematics(panda_model.description.q_ready).position[panda_model.ee]
    far, near = (Fixtures(np.array([[-1.0, 0.0, 0.0, -hand[0] - x]]), no_capsules()) for x in (2.0, 0.2))
    assert scale_of(panda_model, zones, qd=turning, fixtures=far) == clear
    assert scale_of(panda_model, zones, qd=turning, fixtures=near) < clear


def test_nothing_is_met_within_what_is_known_to_stand_there(panda_model):
    whole = Fixtures(np.array([[0.0, 0.0, 1.0, 2.0]]), no_capsules())
    assert scale_of(panda_model, Skin((), panda_model), fixtures=whole) == 1.0


def test_an_arm_on_its_path_keeps_to_the_bound_and_to_the_path(panda_model, paper_skin):
    slow = replace(PROFILES["paper"], unseen=UnseenSpeed(speed_m_s=0.06))
    speeds, off = {}, []
    for name, chosen in (("as asked", PROFILES["paper"]), ("bound", slow)):
        arm = Arm(panda_model, paper_skin, chosen)
        steps = [arm.step() for _ in range(120)]
        speeds[name] = np.linalg.norm(steps[-1].ee_velocity)
        off.append(np.abs(arm.ee()[[0, 2]] - steps[0].ee_position[[0, 2]]).max())
    assert 0.05 < speeds["bound"] < 0.5 * speeds["as asked"]
    assert off[1] < 0.003
    assert steps[-1].speed_scale == pytest.approx(speeds["bound"] / speeds["as asked"], rel=0.1)


def test_a_commander_in_joint_space_is_bounded_too(panda_model):
    bound = replace(PROFILES["paper"], unseen=UnseenSpeed())
    asked, done = 0.8 * np.eye(7)[0], {}
    for name, chosen in (("as asked", PROFILES["paper"]), ("bound", bound)):
        arm = Arm(panda_model, Skin((), panda_model), chosen)
        for _ in range(200):
            desired = joint_velocities(arm.time, asked)
            step, arm.state = arm.controller.step(
                arm.state, Inputs(arm.time, arm.robot(), arm.readings(), desired=desired)
            )
            arm.qd, arm.q, arm.time = step.command, arm.q + step.command * 0.01, arm.time + 0.01
        done[name] = step.command
    assert done["as asked"] == pytest.approx(asked, abs=0.02)
    # slower as a whole: the direction stays
    assert done["bound"] / done["bound"][0] == pytest.approx(asked / asked[0], abs=0.05)
    assert fastest_onto(panda_model, done["bound"]) == pytest.approx(SPEED, rel=0.1)


def test_a_singular_posture_bounds_all_the_same(panda_model):
    found = scale_of(panda_model, Skin((), panda_model), q=np.zeros(7))
    assert 0.0 < found <= 1.0


def test_the_profile_takes_it_by_text():
    assert profile("pretouch:unseen=on").unseen == UnseenSpeed()
    assert profile("pretouch:unseen=on:unseen.speed_m_s=0.05").unseen == UnseenSpeed(speed_m_s=0.05)
    assert PROFILES["paper"].unseen is None
    with pytest.raises(ParameterError, match="speed_m_s is 0"):
        UnseenSpeed(speed_m_s=0.0)
