"""Perception in one call: readings in, obstacles with their closest body points out."""

from dataclasses import replace

import numpy as np

from pretouch.params import PerceptionParams
from pretouch.perception.closest import closest_points, no_obstacles
from pretouch.perception.obstacles import (
    TrackState,
    is_evidence,
    is_fresh,
    locate,
    measured_distance,
    sensor_poses,
    track,
)
from pretouch.perception.scene_filter import Fixtures, expected_range
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RangeReadings


def perceive(
    state: TrackState,
    model: RobotModel,
    skin: Skin,
    fixtures: Fixtures,
    kin: Kinematics,
    readings: RangeReadings,
    now: float,
    params: PerceptionParams,
) -> tuple[Obstacles, TrackState]:
    """Locate what the units see (eq. 1), leave out the arm and fixtures, and find the closest body points."""
    if not params.enabled or len(skin) == 0:
        return no_obstacles(), state
    position, rotation = sensor_poses(skin, kin)
    fresh = np.flatnonzero(is_fresh(state, readings, now))
    if len(fresh):
        distance = measured_distance(readings)
        known = np.full(len(skin), np.inf)
        if params.filter_views:
            known[fresh] = expected_range(
                kin, position[fresh], rotation[fresh], skin.link[fresh], model.capsules, fixtures
            )
        shows = distance < known - params.self_margin_m
        points = locate(position, rotation, np.where(shows, distance, 0.0))
        tells = is_evidence(readings, distance)
        state = track(state, readings, points, shows, tells, now, params.persistence_s)
    unit = np.flatnonzero(now - state.seen <= params.persistence_s)
    if len(unit) == 0:
        return no_obstacles(), state
    beam = rotation[unit, :, 2]
    last = np.where(np.isfinite(state.direction[unit]), state.direction[unit], beam)
    obstacles = closest_points(kin, model.body, kin.position[model.ee], unit, state.point[unit], last)
    direction = state.direction.copy()
    direction[unit] = obstacles.direction
    return obstacles, replace(state, direction=direction)


def silent_units(skin: Skin, state: TrackState, now: float, params: PerceptionParams) -> tuple[float, str]:
    """Factor in [0, 1] on the speed for units that fall silent, and the names of those that are.

    Silence is never free space, and neither is a failure: from `slow_after_s` without a reading that tells anything the
    arm slows, at `silent_after_s` it stands.
    """
    if not params.enabled or len(skin) == 0:
        return 1.0, ""
    age = now - state.heard
    oldest = float(age.max())
    if oldest <= params.slow_after_s:
        return 1.0, ""
    names = ", ".join(skin.ids[k] for k in np.flatnonzero(age >= params.silent_after_s))
    return max(0.0, (params.silent_after_s - oldest) / (params.silent_after_s - params.slow_after_s)), names
