"""The simulated depth camera: what it sees, hides, and how it errs and is late."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.robot.description import panda
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch_lab.depth_camera import DepthCamera, DepthCameraParams, looking, measured_depth

EXACT = DepthCameraParams(
    columns=42, rows=24, noise_1_m=0.0, jitter_s=0.0, frame_loss=0.0, pixel_loss=0.0, edge_loss=0.0, flying=0.0,
    position_error_m=0.0, orientation_error_rad=0.0,
)  # fmt: skip


def rig(panda_model, scene: SceneSpec, pose, params: DepthCameraParams = EXACT, seed: int = 1):
    plant = Plant(panda_model, scene, PlantParams(mass_error=0.0, payload_max_kg=0.0), panda().q_ready, seed)
    return plant, DepthCamera(plant, pose, params, seed)


def on_box(points, box: Box):
    """Which points lie on the surface of a box."""
    beyond = np.abs(points - box.center) - box.half_size
    return np.abs(beyond.max(axis=1)) < 1e-6


BOARD = Box("board", (0.8, 0.0, 0.9), (0.02, 0.3, 0.3), 25_000.0)


def test_points_lie_on_what_is_there_and_the_arm_hides_what_is_behind_it(panda_model):
    hand = HandSpec(radius=0.03, start=(0.307, -0.18, 0.545))
    scene = SceneSpec(boxes=(BOARD,), hand=hand)
    plant, camera = rig(panda_model, scene, looking(np.array([2.0, 0.0, 0.9]), np.array([0.4, 0.0, 0.9])))
    plant.advance(0.2)
    seen = camera.read()
    assert on_box(seen.point, BOARD).sum() > 30
    assert seen.sigma == pytest.approx(0.0)
    for side, hides in ((1.0, True), (-1.0, False)):
        pose = looking(np.array([0.307, side * 1.2, 0.545]), np.array(hand.start))
        plant, camera = rig(panda_model, SceneSpec(hand=hand), pose, replace(EXACT, columns=168, rows=96))
        plant.advance(0.2)
        of_hand = np.abs(np.linalg.norm(camera.read().point - hand.start, axis=1) - hand.radius) < 2e-3
        assert bool(of_hand.any()) is not hides


def test_it_sees_the_arm_itself(panda_model):
    plant, camera = rig(panda_model, SceneSpec(), looking(np.array([1.5, 0.0, 0.5]), np.array([0.3, 0.0, 0.5])))
    plant.advance(0.2)
    low = camera.read().point[:, 2] > -0.1
    assert low.sum() > 20


def test_what_is_too_near_or_too_far_is_not_given(panda_model):
    pose = looking(np.array([2.0, 0.0, 0.9]), np.array([0.4, 0.0, 0.9]))
    for params in (replace(EXACT, range_max_m=1.1), replace(EXACT, range_min_m=1.3)):
        plant, camera = rig(panda_model, SceneSpec(boxes=(BOARD,)), pose, params)
        plant.advance(0.2)
        assert not on_box(camera.read().point, BOARD).any()


def test_a_frame_arrives_late_and_frames_come_at_the_rate(panda_model):
    plant, camera = rig(panda_model, SceneSpec(), looking(np.array([1.5, 0.0, 0.5]), np.zeros(3)))
    stamps, ages = [], []
    assert camera.read().heard == -np.inf
    for _ in range(1000):
        plant.advance(0.001)
        frame = camera.read()
        assert camera.read() is frame
        if frame.heard > -np.inf and (not stamps or frame.heard > stamps[-1]):
            stamps.append(frame.heard)
            ages.append(plant.time - frame.heard)
    assert np.diff(stamps) == pytest.approx(1 / 30, abs=1.1e-3)
    assert np.array(ages) == pytest.approx(EXACT.latency_s, abs=1.1e-3)
    camera.silenced = True
    plant.advance(0.2)
    last = camera.read()
    plant.advance(0.5)
    assert camera.read() is last


def test_an_error_of_its_pose_is_of_the_size_that_sigma_tells(panda_model):
    params = replace(EXACT, position_error_m=0.005, orientation_error_rad=0.005)
    scene, pose = SceneSpec(boxes=(BOARD,)), looking(np.array([2.0, 0.0, 0.9]), np.array([0.4, 0.0, 0.9]))
    share = []
    for seed in range(20):
        plant, camera = rig(panda_model, scene, pose, params, seed)
        plant.advance(0.12)
        seen = camera.read()
        board = (np.abs(seen.point - BOARD.center) < np.array(BOARD.half_size) + 0.05).all(axis=1)
        off = seen.point[board, 0] - (BOARD.center[0] + BOARD.half_size[0])
        share.append(np.mean(np.abs(off) < 2 * seen.sigma[board]))
    assert np.mean(share) > 0.9
    assert 0.005 < seen.sigma[board].mean() < 0.015


def test_noise_grows_with_the_square_of_the_depth():
    params, rng = replace(EXACT, noise_1_m=0.0036), np.random.default_rng(0)
    for depth in (0.5, 1.0, 2.0):
        given = measured_depth(np.full((100, 100), depth), params, rng)[1:-1, 1:-1]
        assert np.nanstd(given) == pytest.approx(0.0036 * depth**2, rel=0.05)


def test_most_of_what_flies_at_an_edge_is_left_out_for_want_of_support():
    true = np.full((48, 84), 2.0)
    true[:, 40:] = 1.0
    rng = np.random.default_rng(0)
    flying = replace(EXACT, flying=0.3)
    given = [measured_depth(true, flying, rng) for _ in range(50)]
    loose = [measured_depth(true, replace(flying, support=1, support_m=10.0), rng) for _ in range(50)]
    between = [np.nansum((depth > 1.05) & (depth < 1.95)) for depth in (np.array(given), np.array(loose))]
    assert between[1] > 300
    assert between[0] < 0.1 * between[1]
    assert np.isnan(measured_depth(np.full((5, 5), np.inf), EXACT, rng)).all()


def test_a_camera_looks_where_it_is_told():
    T = looking(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.0]))
    assert T[:3, :3].T @ T[:3, :3] == pytest.approx(np.eye(3))
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    assert T[:3, 2] == pytest.approx(-np.array([1.0, 2.0, 3.0]) / np.sqrt(14))
    assert T[2, 1] < 0, "its y axis is down"
