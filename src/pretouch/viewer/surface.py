"""The surface of a body made of capsules, with vertices dense enough to be coloured."""

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
import trimesh

from pretouch.robot.body import Capsules
from pretouch.types import FloatArray

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
