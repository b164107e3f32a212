"""Points while things and the arm move: the speed of things, and late readings."""

from dataclasses import replace

import numpy as np
import pytest
from tests.perception.watcher import Watcher, readings_of

from pretouch.params import PerceptionParams
from pretouch.perception.obstacles import follow_points, move_back, placed_sensors, track_init
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.robot.kinematics import Chain

MEMORY, PERIOD = 0.09, 0.02
AWAY = np.array([0.0, 0.0, 1.0])


def followed(distance, stamps=None, memory=MEMORY) -> list[float]:
    """Speeds [m/s] towards a unit that looks up from the origin, after each of its readings."""
    stamps = PERIOD * np.arange(len(distance)) if stamps is None else stamps
    tracks, speeds = track_init(1), []
    for t, d in zip(stamps, distance, strict=True):
        point, stamp = d * AWAY[None], np.array([t])
        follow_points(tracks, point, stamp, np.ones(1, np.bool_), memory)
        tracks = tracks._replace(point=point, point_stamp=stamp)
        speeds.append(-float(tracks.motion[1, 0] @ AWAY))
    return speeds


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.6, -0.3])
def test_a_steady_approach_is_followed_without_bias(speed):
    assert followed(1.0 - speed * PERIOD * np.arange(60))[-1] == pytest.approx(speed, abs=0.01 * abs(speed))


def test_a_hand_that_sets_out_is_followed_in_a_third_of_a_second():
    d = np.concatenate([np.full(50, 0.8), 0.8 - 0.5 * PERIOD * np.arange(1, 30)])
    found = np.array(followed(d))
    assert found[49] == 0.0
    assert np.argmax(found[50:] > 0.25) * PERIOD <= 0.14
    assert np.argmax(found[50:] > 0.45) * PERIOD <= 0.35


def test_range_noise_leaves_little_of_a_thing_at_rest():
    rng = np.random.default_rng(1000)
    for sigma, allowed in ((0.005, 0.015), (0.02, 0.06)):
        found = np.array(followed(0.5 + sigma * rng.normal(size=4000)))[50:]
        assert abs(found.mean()) < 0.005
        assert found.std() < allowed


def test_a_reading_of_another_surface_begins_anew():
    found = followed([0.9, 0.89, 0.88, 0.4, 0.4, 0.4])
    assert found[2] > 0
    assert found[3:] == [0.0, 0.0, 0.0]


def test_after_a_silence_it_begins_anew():
    found = followed([0.9, 0.88, 0.86, 0.7], stamps=[0.0, 0.02, 0.04, 0.4])
    assert found[2] > 0
    assert found[3] == 0.0


# late readings of an arm that moves: with the pose at their stamp, what stands still is where it stands


LATE_S = 0.05
QD = np.array([0.8, -0.2, 0.1, 0.3, 0.0, 0.4, 0.6])


def errors(model, skin, params: PerceptionParams, noise: float = 0.0) -> list[float]:
    """How far from a plane ahead of a unit its points are [m], while the arm turns and the readings are late."""
    unit, rng, q0 = skin.ids.index("hand_left"), np.random.default_rng(1000), model.description.q_ready
    position, rotation, _ = placed(model, skin, q0)
    normal, on = rotation[unit, :, 2].copy(), position[unit] + 0.5 * rotation[unit, :, 2]
    watcher, off = Watcher(model, skin, no_fixtures(), params), []
    for i in range(6, 60):
        now = 0.01 * i
        then = now - LATE_S
        at, turned, _ = placed(model, skin, q0 + QD * then)
        beam = turned[unit, :, 2]
        distance = float((on - at[unit]) @ normal / (beam @ normal)) + noise * rng.standard_normal()
        readings = readings_of(skin, then, hand_left=distance)
        watcher.q, watcher.qd = q0 + QD * now, QD
        watcher.take(readings, now)
        off.append(float((watcher.state.point[unit] - on) @ normal))
    return off


def placed(model, skin, q):
    return placed_sensors(skin.arrays, model.kinematics(q))


def test_a_plane_stays_where_it_is_while_the_arm_turns(panda_model, paper_skin):
    exact = replace(PROFILES["pretouch"].perception, spread_sigmas=0.0)
    late = replace(exact, memory=None, outside=None)
    assert max(map(abs, errors(panda_model, paper_skin, exact))) < 0.004
    assert max(map(abs, errors(panda_model, paper_skin, late))) > 0.01, "and not where the arm has gone on to"


def test_poses_go_back_as_the_arm_came(panda_model, paper_skin):
    q = panda_model.description.q_ready
    sensors = placed(panda_model, paper_skin, q)
    kin, age = panda_model.kinematics(q), 0.001
    stamp = np.full(len(paper_skin), 7.0 - age)
    move_back(
        sensors, np.ones(len(stamp), np.bool_), stamp, Chain(kin.anchor, kin.axis, panda_model.moved_by, QD), 7.0,
        np.full(len(stamp), 0.06),
    )  # fmt: skip
    position, rotation, _ = sensors
    at, turned, _ = placed(panda_model, paper_skin, q - QD * age)
    np.testing.assert_allclose(position, at, atol=1e-6)
    np.testing.assert_allclose(rotation, turned, atol=1e-6)
    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1), np.tile(np.eye(3), (len(at), 1, 1)), atol=1e-12)


def test_no_reading_is_moved_back_by_more_than_it_lasts_nor_into_the_future(panda_model, paper_skin):
    q = panda_model.description.q_ready
    kin = panda_model.kinematics(q)
    chain = Chain(kin.anchor, kin.axis, panda_model.moved_by, QD)
    here = placed(panda_model, paper_skin, q)
    stays, lives = placed(panda_model, paper_skin, q), np.full(len(paper_skin), 0.06)
    move_back(stays, np.ones(len(paper_skin), np.bool_), np.full(len(paper_skin), 7.5), chain, 7.0, lives)
    np.testing.assert_array_equal(stays.position, here.position)
    for stamp, same in ((-np.inf, 6.94), (6.0, 6.94)):
        first, second = placed(panda_model, paper_skin, q), placed(panda_model, paper_skin, q)
        for at, pose in ((stamp, first), (same, second)):
            stamps = np.full(len(paper_skin), at)
            move_back(pose, np.ones(len(stamps), np.bool_), stamps, chain, 7.0, lives)
        np.testing.assert_allclose(first[0], second[0], atol=1e-12)
