"""What a sensor is expected to see of the arm and of fixtures, which is no obstacle."""

from contextlib import suppress
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation
from tests.perception.watcher import FLOOR, HAND_LEFT, Watcher

from pretouch.coverage.ways import expected_range
from pretouch.errors import SkinError
from pretouch.params import PerceptionParams
from pretouch.perception.closest import closest_points
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import Fixtures, no_fixtures, ray_capsule
from pretouch.profiles import PROFILES
from pretouch.robot.body import Capsules
from pretouch.robot.description import panda
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, Sensors, cone_rays, cones_of
from pretouch.sensing.skin import Skin, skin_for

INF = np.inf
NOTHING = no_fixtures()
LOW, HIGH = np.zeros(3), np.array([0.0, 0.0, 1.0])
vectors = arrays(np.float64, 3, elements=st.floats(-2, 2))


def _ray(p, towards, radius=0.1, a=LOW, b=HIGH) -> float:
    ray = np.array(towards, dtype=np.float64)
    return ray_capsule(np.array(p, dtype=np.float64), ray / np.linalg.norm(ray), a, b, radius)


def _rod(x: float, y: float, radius: float, link: int = 0) -> Capsules:
    """An upright rod of a link."""
    return Capsules(np.array([link]), np.array([[x, y, -1.0]]), np.array([[x, y, 1.0]]), np.array([radius]))


def _looking(p, along, fixtures: Fixtures, body: Capsules = NOTHING.capsules, own: int = 1) -> float:
    """What one sensor at p that looks along a direction is expected to see; it sits on the link `own`."""
    still = Kinematics(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((0, 3)), np.zeros((0, 3)))
    along = np.array(along, dtype=np.float64) / np.linalg.norm(along)
    R = Rotation.align_vectors([along], [[0, 0, 1]])[0].as_matrix()
    sensors = Sensors(np.array(p, dtype=np.float64)[None], R[None], np.array([own]))
    return float(expected_range(still, sensors, cones_of([PAPER_SENSOR]), body, fixtures)[0])


# One ray, one capsule


@pytest.mark.parametrize(
    ("p", "towards", "distance"),
    [
        ((1, 0, 0.5), (0, 0, 1), INF),  # past it
        ((0, 0, 2), (0, 0, -1), 0.9),  # its end, along the axis
        ((0.06, 0, -1), (0, 0, 1), 0.92),  # its other end, beside the axis: 1 - sqrt(0.1^2 - 0.06^2)
        ((0.11, 0, -1), (0, 0, 1), INF),  # parallel to it, just outside
        ((0, 0, 0.5), (1, 0, 0), 0.0),  # from the axis
        ((0.05, 0, 1.05), (0, 0, 1), 0.0),  # from within an end
    ],
)
def test_a_ray_meets_a_rod(p, towards, distance):
    assert _ray(p, towards) == pytest.approx(distance, abs=1e-12)


@pytest.mark.parametrize(
    ("p", "towards", "distance"),
    [
        ((2, 0, 0), (-1, 0, 0), 1.9),
        ((-1.2, -0.9, 0), (0.8, 0.6, 0), 1.4),
        ((2, 0, 0.06), (-1, 0, 0), 1.92),
        ((2, 0, 0.11), (-1, 0, 0), INF),
        ((2, 0, 0), (1, 0, 0), INF),
        ((0, 0, 0), (1, 0, 0), 0.0),
    ],
)
def test_a_capsule_of_no_length_is_met_as_a_ball(p, towards, distance):
    assert _ray(p, towards, b=LOW) == pytest.approx(distance, abs=1e-12)


@given(p=vectors, towards=vectors, a=vectors, b=vectors, radius=st.floats(0.02, 0.5))
def test_a_ray_meets_a_capsule_where_mujoco_says(p, towards, a, b, radius):
    length = np.linalg.norm(b - a)
    assume(np.linalg.norm(towards) > 0.1)
    assume(length > 1e-3)
    axis = a + np.linspace(0, 1, 4001)[:, None] * (b - a)
    assume(np.linalg.norm(axis - p, axis=1).min() > radius + 1e-4)  # from inside MuJoCo answers where the ray leaves
    towards = towards / np.linalg.norm(towards)
    R = Rotation.align_vectors([(b - a) / length], [[0, 0, 1]])[0].as_matrix()
    size = np.array([radius, length / 2, 0])
    met = mujoco.mju_rayGeom((a + b) / 2, R.ravel(), size, p, towards, mujoco.mjtGeom.mjGEOM_CAPSULE)
    assert _ray(p, towards, radius, a, b) == pytest.approx(met if met >= 0 else INF, abs=1e-7)


@pytest.mark.parametrize("lift", [0.0, 1e-17, 1e-16, 1e-15, 1e-12, 1e-9])
def test_a_ray_into_the_rod_from_its_very_surface_is_met_at_once(lift):
    rng = np.random.default_rng(3)
    for turn, height, radius in rng.uniform([0, 0, 0.02], [2 * np.pi, 1, 0.5], size=(300, 3)):
        outwards = np.array([np.cos(turn), np.sin(turn), 0.0])
        start = height * HIGH + (radius + lift) * outwards
        distance = _ray(start, -outwards, radius)
        assert distance >= 0.0
        assert distance == pytest.approx(lift, abs=1e-12)


# A sensor's cone


CORNER = Fixtures(np.array([[0.0, 0, 1, 0], [-1.0, 0, 0, -3]]), no_fixtures().capsules)
"""A floor, and a wall at x = 3."""


@pytest.mark.parametrize(
    ("p", "along", "fixtures", "seen"),
    [
        ((0.3, 0.1, 0.5), (0, 0, -1), FLOOR, 0.7),  # below
        ((0, 0, 0.5), (0, 0, 1), FLOOR, INF),  # it looks up
        ((0, 0, 0.5), (1, 0, 0.3), FLOOR, INF),
        ((0, 0, 0.5), (0, -1, 0.3), FLOOR, INF),
        ((0, 0, -0.5), (0, 0, -1), FLOOR, INF),  # a plane hides nothing from behind
        ((0, 0, -0.5), (0, 0, 1), FLOOR, INF),
        ((0, 0, -0.2), (0, 0, -1), FLOOR, 0.0),  # on it
        ((2.5, 0, 1), (1, 0, 0), CORNER, 0.5),  # the nearest counts
        ((0.5, 0, 0.25), (0, 0, -1), CORNER, 0.25),
        ((0, 0, 0), (1, 0, 0), NOTHING, INF),
    ],
)
def test_a_plane_is_seen_from_its_front_at_its_distance(p, along, fixtures, seen):
    assert _looking(p, along, fixtures) == pytest.approx(seen)


@given(height=st.floats(0.01, 2), tilt=st.floats(0, 1.2), turn=st.floats(0, 6.3))
def test_the_floor_is_seen_by_the_lowest_ray_of_the_cone(height, tilt, turn):
    along = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    seen = _looking((0, 0, height - 0.2), along, FLOOR)
    assert height / np.cos(max(0.0, tilt - PAPER_SENSOR.angle / 2)) <= seen + 1e-12
    assert seen <= height / np.cos(tilt) + 1e-12  # no farther than along the beam


def test_a_post_is_seen_off_the_beam_but_within_the_cone():
    for degrees, visible in ((0, True), (13, True), (20, False)):
        y = np.tan(np.deg2rad(degrees))
        post = Fixtures(np.zeros((0, 4)), _rod(1.0, y, 0.02))
        assert np.isfinite(_looking((0, 0, 0), (1, 0, 0), post)) == visible


def test_a_unit_sees_other_links_but_not_its_own():
    for own, seen in ((0, 0.9), (1, INF)):
        assert _looking((0, 0, 0), (1, 0, 0), NOTHING, _rod(1.0, 0.0, 0.1, link=1), own) == pytest.approx(seen)


def test_the_arm_is_seen_where_mujocos_rays_meet_it(panda_model, paper_skin):
    model = mujoco.MjModel.from_xml_path(str(panda().mjcf))
    data = mujoco.MjData(model)
    rays, seen, buried = cone_rays(2, PAPER_SENSOR.angle), 0, 0
    for fraction in np.random.default_rng(1).uniform(size=(500, 7)):
        q = panda_model.q_min + fraction * (panda_model.q_max - panda_model.q_min)
        kin = panda_model.kinematics(q)
        position, rotation, _ = placed_sensors(paper_skin.arrays, kin)
        expected = expected_range(
            kin, placed_sensors(paper_skin.arrays, kin), paper_skin.cones, panda_model.capsules, NOTHING
        )
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        for k, own in enumerate(paper_skin.link):
            others = panda_model.capsules.of_links(np.setdiff1d(panda_model.capsules.link, [own]))
            here = closest_points(kin, others, np.zeros(3), np.zeros(1, np.int64), position[k : k + 1], np.eye(3)[:1])
            if here.body_distance[0] <= 0:  # the posture drives the unit into another link
                assert expected[k] == 0
                buried += 1
                continue
            met, geom = np.zeros(len(rays)), np.zeros(len(rays), np.int32)
            along = (rays @ rotation[k].T).ravel()
            mujoco.mj_multiRay(model, data, position[k], along, None, True, own, geom, met, None, len(rays), 1e6)
            nearest = np.where(met < 0, INF, met).min()
            assert expected[k] == pytest.approx(nearest, abs=1e-7)
            seen += np.isfinite(nearest)
    assert seen > 200
    assert buried > 10


# the arm itself, seen by a unit that is not quite where it is believed to be


ASIDE = PerceptionParams(self_aside_m=0.005)


def placed_by_hand(skin: Skin, model: RobotModel, seed: int) -> Skin:
    """Units 5 mm off in random directions, and turned by 3 degrees about random axes; not inside their links."""
    units = []
    for k, unit in enumerate(skin.mounted):
        for off, axis in np.random.default_rng([seed, 13, k]).standard_normal((20, 2, 3)):
            T = unit.T_link_sensor.copy()
            T[:3, 3] += 0.005 * off / np.linalg.norm(off)
            turn = Rotation.from_rotvec(3.0 * axis / np.linalg.norm(axis), degrees=True)
            T[:3, :3] = T[:3, :3] @ turn.as_matrix()
            with suppress(SkinError):
                units += Skin([replace(unit, T_link_sensor=T)], model).mounted
                break
    return Skin(units, model)


def test_units_a_little_elsewhere_do_not_take_their_own_arm_for_an_obstacle(panda_model):
    rng = np.random.default_rng(5)
    as_ours = PerceptionParams(self_aside_m=PROFILES["pretouch"].perception.self_aside_m)
    shown, readings = 0, 0
    for seed in range(15):
        truly = Skin([replace(u, sensor=PAPER_SENSOR) for u in skin_for(panda_model).mounted], panda_model)
        believed = placed_by_hand(truly, panda_model, seed)
        watcher = Watcher(panda_model, believed, no_fixtures(), as_ours)
        for now in range(1, 51):  # a second apart, so that nothing is remembered
            watcher.q = rng.uniform(panda_model.q_min, panda_model.q_max)
            kin = panda_model.kinematics(watcher.q)
            at = expected_range(
                kin, placed_sensors(truly.arrays, kin), truly.cones, panda_model.capsules, no_fixtures()
            )
            near = {u: max(d, PAPER_SENSOR.nearest_m) for u, d in zip(truly.ids, at, strict=True) if d < 0.3}
            readings += len(near)
            shown += len(watcher.see(now, **near).unit)
    assert readings > 1000
    assert shown < 20  # 30 without the allowance


@pytest.mark.parametrize(("distance", "shown"), [(0.05, 1), (0.18, 1), (0.2, 0), (0.22, 0), (0.25, 1), (0.5, 1)])
def test_what_is_barely_missed_explains_what_is_about_there_and_hides_nothing(panda_model, paper_skin, distance, shown):
    # a post whose surface lies 3 mm outside of the cone, 0.2 m before the unit of the hand that looks along +y, and so
    # 51 mm from the beam: d tan(13.5 degrees) + 5 mm is as much from about 0.19 m on, and 55 mm at 0.21 m
    edge = 0.2 * np.tan(PAPER_SENSOR.angle / 2) + 0.003 / np.cos(PAPER_SENSOR.angle / 2)
    post = HAND_LEFT + np.array([0.0, 0.2, edge + 0.01 / np.cos(PAPER_SENSOR.angle / 2)])
    ends = post[None] - np.array([0.3, 0, 0]), post[None] + np.array([0.3, 0, 0])
    beside = Fixtures(np.zeros((0, 4)), Capsules(np.zeros(1, np.int64), *ends, np.full(1, 0.01)))
    assert len(Watcher(panda_model, paper_skin, beside, ASIDE).see(1.0, hand_left=distance).unit) == shown
