"""Where on the arm contact is expected: the units' readings, spread over the surface round them (paper, Fig. 1).

The formula is ours, the paper gives none. A unit whose obstacle is at distance d from the body expects contact by e =
(d_max - d) / (d_max - d_min), clipped to [0, 1], as eq. 11 grades it. A vertex at distance r from a unit, whose normal
makes the angle phi with the unit's beam, takes the share w = (1 - (r / L)^2)^2 (1 + cos phi) / 2 of it, 0 from r = L
on, and what several units expect adds up as 1 - prod(1 - e w).
"""

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
import trimesh

from pretouch.contact.moving_thresholds import obstacle_force
from pretouch.params import ThresholdParams
from pretouch.robot.body import Capsules
from pretouch.types import FloatArray, Obstacles

EDGE_M = 0.02
"""Distance of vertices along a capsule [m], at most: between them a colour runs evenly."""

AROUND = 18
"""Vertices round a capsule."""


def surface_of(capsules: Capsules, around: int = AROUND) -> trimesh.Trimesh:
    """Join the surfaces of capsules, at least one. Parts inside other capsules stay: they are not seen."""
    parts = zip(capsules.a, capsules.b, capsules.radius, strict=True)
    return joined([_surface(a, b, float(radius), around) for a, b, radius in parts])


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Put meshes into one."""
    return cast("trimesh.Trimesh", trimesh.util.concatenate(meshes))


def _surface(a: FloatArray, b: FloatArray, radius: float, around: int) -> trimesh.Trimesh:
    length = float(np.linalg.norm(b - a))
    T = np.eye(4) if length == 0.0 else trimesh.geometry.align_vectors((0, 0, 1), b - a)
    T[:3, 3] = a
    tilt = np.linspace(0.0, np.pi / 2, around // 4 + 1)[1:]
    across, up = radius * np.cos(tilt), radius * np.sin(tilt)
    across[-1] = 0.0  # the poles
    straight = np.linspace(0.0, length, math.ceil(length / EDGE_M) + 1) if length else np.zeros(1)
    profile = np.concatenate([across[::-1], np.full(len(straight), radius), across])
    height = np.concatenate([-up[::-1], straight, length + up])
    return trimesh.creation.revolve(np.column_stack([profile, height]), sections=around, transform=T)


SPREAD_M = 0.12
"""Distance L from a unit at which its reading colours the surface no more [m]."""

LEVELS = 24
"""Steps from nothing expected to all of it: a part whose units keep theirs is not sent again."""


def expectation(obstacles: Obstacles, units: int, params: ThresholdParams) -> FloatArray:
    """By how much each of the units (K,) expects contact, from 0 to 1; 0 for one that shows no obstacle."""
    expected = np.zeros(units)
    if len(obstacles.unit):
        graded = obstacle_force(obstacles.body_distance, 1.0, params.d_max_m, params.d_min_m)
        own = obstacles.unit < units  # what other sources see is at no unit
        np.maximum.at(expected, obstacles.unit[own], graded[own])
    return expected


def in_levels(expected: FloatArray) -> tuple[int, ...]:
    """Round to the nearest of `LEVELS` steps."""
    return tuple(np.rint(expected * LEVELS).astype(int).tolist())


def shares(vertices: FloatArray, normals: FloatArray, origin: FloatArray, beam: FloatArray) -> FloatArray:
    """Shares w (V, K) that vertices have in what units expect.

    Args:
        vertices: (V, 3) [m].
        normals: (V, 3) unit vectors, outwards.
        origin: (K, 3) of the units [m], same frame.
        beam: (K, 3) unit vectors, same frame.
    """
    apart = np.linalg.norm(vertices[:, None] - origin[None], axis=2)
    near = np.maximum(1.0 - (apart / SPREAD_M) ** 2, 0.0) ** 2
    return near * (1.0 + normals @ beam.T) / 2.0


def on_surface(share: FloatArray, expected: FloatArray) -> FloatArray:
    """By how much contact is expected at each vertex (V,), of shares (V, K) and what the units expect (K,)."""
    return 1.0 - np.prod(1.0 - share * expected, axis=1)
