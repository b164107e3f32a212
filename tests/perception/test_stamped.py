"""Late readings of an arm that moves: with the pose at their stamp, what stands still is where it stands."""

from dataclasses import replace

import numpy as np
import pytest
from tests.perception.watcher import Watcher, readings_of

from pretouch.params import PerceptionParams
from pretouch.perception.motion_compensation import move_back
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.robot.kinematics import Chain

LATE_S = 0.05
QD = np.array([0.8, -0.2, 0.1, 0.3, 0.0, 0.4, 0.6])


def errors(model, skin, params: PerceptionParams, noise: float = 0.0) -> list[float]:
    """How far from a plane ahead of a unit its points are [m], while the arm turns and the readings are late."""
    unit, rng, q0 = skin.ids.index("hand_left"), np.random.default_rng(1000), model.description.q_ready
    position, rotation, _ = placed(model, skin, q0)
    normal, on = rotation[unit, :, 2].copy(), position[unit] + 0.5 * rotation[unit, :, 2]
    watcher, found = Watcher(model, skin, no_fixtures(), params), []
    for i in range(6, 60):
        now = 0.01 * i
        then = now - LATE_S
        at, turned, _ = placed(model, skin, q0 + QD * then)
        beam = turned[unit, :, 2]
        distance = float((on - at[unit]) @ normal / (beam @ normal)) + noise * rng.standard_normal()
        readings = readings_of(skin, then, hand_left=distance)
        watcher.q, watcher.qd = q0 + QD * now, QD
        found.append(float((watcher.take(readings, now).point[0] - on) @ normal))
    return found


def placed(model, skin, q):
    return placed_sensors(skin.arrays, model.kinematics(q))


def test_a_plane_stays_where_it_is_while_the_arm_turns(panda_model, paper_skin):
    exact = replace(PROFILES["pretouch"].perception, spread_sigmas=0.0)
    late = replace(exact, place_at_stamp=False)
    assert max(map(abs, errors(panda_model, paper_skin, exact))) < 0.004
    assert max(map(abs, errors(panda_model, paper_skin, late))) > 0.01, "and not where the arm has gone on to"


def test_with_noise_its_place_is_within_noise(panda_model, paper_skin):
    found = np.array(errors(panda_model, paper_skin, PROFILES["pretouch"].perception, 0.02))
    assert abs(found.mean()) < 2 * 0.02 / np.sqrt(len(found))
    assert found.std() == pytest.approx(0.02, rel=0.25)


def test_poses_go_back_as_the_arm_came(panda_model, paper_skin):
    q = panda_model.description.q_ready
    sensors = placed(panda_model, paper_skin, q)
    kin, age = panda_model.kinematics(q), 0.001
    stamp = np.full(len(paper_skin), 7.0 - age)
    move_back(
        sensors, np.ones(len(stamp), np.bool_), stamp, Chain(kin.anchor, kin.axis, panda_model.moved_by, QD), 7.0, 0.06
    )
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
    stays = placed(panda_model, paper_skin, q)
    move_back(stays, np.ones(len(paper_skin), np.bool_), np.full(len(paper_skin), 7.5), chain, 7.0, 0.06)
    np.testing.assert_array_equal(stays.position, here.position)
    for stamp, same in ((-np.inf, 6.94), (6.0, 6.94)):
        first, second = placed(panda_model, paper_skin, q), placed(panda_model, paper_skin, q)
        for at, pose in ((stamp, first), (same, second)):
            stamps = np.full(len(paper_skin), at)
            move_back(pose, np.ones(len(stamps), np.bool_), stamps, chain, 7.0, 0.06)
        np.testing.assert_allclose(first[0], second[0], atol=1e-12)
