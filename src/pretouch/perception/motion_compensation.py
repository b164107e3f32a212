"""Where the sensors were when they measured, and how fast an object itself comes nearer than the arm's motion says."""

import math

import numpy as np

from pretouch.compiled import kernel
from pretouch.perception.obstacles import TrackState
from pretouch.robot.kinematics import Chain, point_velocity
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.types import BoolArray, FloatArray, Obstacles


@kernel
def move_back(
    sensors: Sensors, moved: BoolArray, stamp: FloatArray, chain: Chain, posed: float, longest: float
) -> None:
    """Move sensor poses, (K, 3) [m] and (K, 3, 3), from the instant of the arm's posture back to their stamps (K,) [s].

    That is the motion of their links at the joint velocities (n,) [rad/s], to first order in the place; the rotation is
    exact for a constant angular velocity. No reading is taken for older than `longest` [s].

    Args:
        sensors: changed.
        moved: (K,) which of them.
        stamp: of the readings.
        chain: of the arm.
        posed: instant of the arm's posture [s].
        longest: see above.
    """
    position, rotation, unit_link = sensors
    axis, moved_by, qd = chain.axis, chain.moved_by, chain.qd
    w, turned = np.empty(3), np.empty(3)
    for k in range(len(unit_link)):
        age = min(posed - stamp[k], longest)
        # measured after the posture: how the arm goes on is not known
        if not moved[k] or not age > 0.0:
            continue
        v = point_velocity(chain, unit_link[k], position[k, 0], position[k, 1], position[k, 2])
        w[:] = 0.0  # the sum of qd_j a_j, over the joints that move the link
        for j in range(len(qd)):
            if moved_by[unit_link[k], j]:
                for i in range(3):
                    w[i] += axis[j, i] * qd[j]
        speed = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        for i in range(3):
            position[k, i] -= age * v[i]  # p(stamp) = p - age v, to first order
        if speed == 0.0:  # there is no axis to turn about
            continue
        # R(stamp) = exp(-age [w]) R by the formula of Rodrigues, column by column
        s, c = math.sin(-age * speed), math.cos(age * speed)
        for i in range(3):
            w[i] /= speed
        for column in range(3):
            a, b, d = rotation[k, 0, column], rotation[k, 1, column], rotation[k, 2, column]
            along = (1.0 - c) * (w[0] * a + w[1] * b + w[2] * d)
            turned[0] = c * a + s * (w[1] * d - w[2] * b) + along * w[0]
            turned[1] = c * b + s * (w[2] * a - w[0] * d) + along * w[1]
            turned[2] = c * d + s * (w[0] * b - w[1] * a) + along * w[2]
            for i in range(3):
                rotation[k, i, column] = turned[i]


FASTEST = 2.0
"""Fastest motion of a person's hand that is believed [m/s]."""
_ON_ITS_OWN = 0.1
"""Speed above which something nearer than a sensor measures is taken to come nearer by itself [m/s]."""
_JUMP = 0.06
"""By how much two readings of one surface may differ beside that, noise and the width of the cone [m]."""


@kernel
def follow_points(tracks: TrackState, points: FloatArray, stamp: FloatArray, taken: BoolArray, memory: float) -> None:
    """Take the points (K, 3) [m] of `stamp` (K,) [s] that are `taken` (K,) into the motion of the tracks.

    A fading-memory filter, the least squares of a straight line with weights that fall by 1/e in `memory` [s]: with
    theta = exp(-dt / memory) it corrects the place by 1 - theta^2 and the velocity by (1 - theta)^2 / dt of what was
    not foreseen. A point farther from the unit's last than a hand moves is of another surface, and begins anew, with
    velocity 0. The tracks still hold what was seen last.
    """
    motion, last = tracks.motion, tracks.point
    for k in range(len(taken)):
        if not taken[k]:
            continue
        dt, away2 = stamp[k] - tracks.seen[k], 0.0
        for i in range(3):
            away2 += (points[k, i] - last[k, i]) ** 2
        # not the first reading, whose dt is infinite, nor one after three memories: e^-3 of the old weight is left then
        goes_on = not np.isnan(motion[0, k, 0]) and 0.0 < dt <= 3.0 * memory
        if not goes_on or away2 > (FASTEST * dt + _JUMP) ** 2:
            for i in range(3):
                motion[0, k, i], motion[1, k, i] = points[k, i], 0.0
            continue
        # The gains of the steady state, from the second reading on: two noisy points alone would give any velocity.
        theta = np.exp(-dt / memory)
        for i in range(3):
            foreseen = motion[0, k, i] + dt * motion[1, k, i]
            missed = points[k, i] - foreseen
            motion[0, k, i] = foreseen + (1.0 - theta * theta) * missed
            motion[1, k, i] += (1.0 - theta) ** 2 / dt * missed


@kernel
def reckon(
    points: FloatArray, distance: FloatArray, stamp: FloatArray, tracks: TrackState, sensors: Sensors, cones: Cones,
    within: float,
) -> None:  # fmt: skip
    """Put points (K, 3) that are nearer than the sensor measures where they were last seen, as far as that may be.

    A reading of the nearest distance that a sensor measures, `least` [m], says only that something is between 0 and
    that. Where the unit saw a point up to `within` [s] before, it is on the beam at the height of that, moved on if it
    came nearer by itself faster than 0.1 m/s; where it saw none, it is at the sensor. `stamp` (K,) [s] is that of the
    reading; the tracks still hold what was seen last.
    """
    last, motion = tracks.point, tracks.motion
    position, rotation = sensors.position, sensors.rotation
    for k in range(len(distance)):
        least = cones.range[cones.kind[k], 0]
        # `measured` has raised what is nearer to that, and NaN is passed over
        if not distance[k] <= least:
            continue
        dt, ahead, nearing = stamp[k] - tracks.seen[k], 0.0, 0.0
        if 0.0 <= dt <= within:
            for i in range(3):
                # height of the last point along the beam as it is now, and speed of that point against the beam
                ahead += rotation[k, i, 2] * (last[k, i] - position[k, i])
                if not np.isnan(motion[1, k, i]):
                    nearing -= rotation[k, i, 2] * motion[1, k, i]
            # Slower may be the estimate's error for an object at rest, 2.5 % of which err by more (anticipation.md).
            # That the arm itself comes nearer is in the sensor's pose already.
            if nearing > _ON_ITS_OWN:
                ahead -= dt * nearing
        # the reading holds all the same: between the sensor and `least`
        ahead = min(max(ahead, 0.0), least)
        for i in range(3):
            points[k, i] = position[k, i] + rotation[k, i, 2] * ahead


@kernel
def closing_speeds(motion: FloatArray, obstacles: Obstacles) -> None:
    """Write the speed at which each obstacle comes nearer: its velocity, of the tracks' motion, against its direction.

    0 where nothing is known, never more than a person's hand reaches.
    """
    for m in range(len(obstacles.unit)):
        k, speed = obstacles.unit[m], 0.0
        if not np.isnan(motion[0, k, 0]):
            for i in range(3):
                speed -= motion[1, k, i] * obstacles.direction[m, i]  # -v . u, u from the body to the object
        obstacles.closing_speed[m] = min(max(speed, -FASTEST), FASTEST)
