"""Which directions of a unit's pose a motion has made observable, and which not."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.fit import PLACE, TURN
from pretouch.types import FloatArray

_POSITION_SIGMA_M = 0.01
"""An answer with a larger standard deviation of its position, in any direction, is refused [m]."""
_ORIENTATION_SIGMA_DEG = 2.0
"""An answer with a larger standard deviation of its orientation, about any axis, is refused [degrees]."""
_SAME = 0.9
"""Share of a direction that lies in what is not known, from which on it is named as not known."""


@dataclass(frozen=True)
class Axis:
    """Axis of the last joint that moves a link, in the link's frame."""

    joint: str
    point: FloatArray
    """(3,) [m]."""
    direction: FloatArray
    """(3,) unit vector."""


def observability(
    covariance: FloatArray, T_link_sensor: FloatArray, axis: Axis
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Say in words what of a pose is not known as well as it has to be, and what is known nevertheless.

    Both are empty if all of it is known.

    Args:
        covariance: (6, 6) of rotation vector in the sensor frame [rad] and position in the link frame [m].
        T_link_sensor: (4, 4) the pose.
        axis: of the last joint that moves the link.
    """
    turned = np.eye(6)
    turned[TURN, TURN] = T_link_sensor[:3, :3]
    C = turned @ covariance @ turned.T
    r = T_link_sensor[:3, 3] - axis.point
    limit = np.repeat((np.deg2rad(_ORIENTATION_SIGMA_DEG), _POSITION_SIGMA_M), 3)
    span, freedoms = _joint_freedoms(C / np.outer(limit, limit), r, axis, limit)
    unknown = (*freedoms, *_directions(C / np.outer(limit, limit), span, limit))
    return unknown, _seen_from(C, r, axis) if len(freedoms) == 2 else ()


def _joint_freedoms(
    scaled: FloatArray, r: FloatArray, axis: Axis, limit: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Take what a joint's axis leaves open out of what is not known.

    A turn about an axis moves the unit too: rotation and position are looked at together, in parts of their limits.

    Returns:
        (6, k) orthonormal columns: what else is not known; and the joint's own freedoms in words.
    """
    none = np.zeros(3)
    freedoms = {
        f"where it sits along the axis of {axis.joint}": np.concatenate([none, axis.direction]),
        f"its angle about the axis of {axis.joint}": np.concatenate([axis.direction, np.cross(axis.direction, r)]),
    }
    variance, vectors = np.linalg.eigh(scaled)
    span, words = vectors[:, variance > 1.0], []
    for name, freedom in freedoms.items():
        unit = freedom / limit / np.linalg.norm(freedom / limit)
        if np.sum((unit @ span) ** 2) > _SAME:
            words.append(name)
            left, size, _ = np.linalg.svd(span - np.outer(unit, unit @ span), full_matrices=False)
            span = left[:, size > 0.5]
    return span, tuple(words)


def _directions(scaled: FloatArray, span: FloatArray, limit: FloatArray) -> list[str]:
    """Name the directions of position and orientation in what is spanned (6, k) that are beyond their limits."""
    rest = span @ (span.T @ scaled @ span) @ span.T
    words = []
    for part, name, factor, si in (
        (PLACE, "its position along", 1e3, "mm"),
        (TURN, "its orientation about", np.rad2deg(1.0), "degrees"),
    ):
        variance, vectors = np.linalg.eigh(rest[part, part])
        for value, direction in zip(variance, vectors.T, strict=True):
            if value > 1.0:
                size = factor * np.sqrt(value) * limit[part][0]
                words.append(f"{name} {_in_words(direction)} of the link (sigma {size:.3g} {si})")
    return words


def _seen_from(C: FloatArray, r: FloatArray, axis: Axis) -> tuple[str, ...]:
    """Say what of a unit is known about whose angle around an axis, and whose place along it, nothing is."""
    outwards = r - axis.direction * (r @ axis.direction)
    distance = float(np.linalg.norm(outwards))
    if distance < 1e-3:
        return ()
    outwards /= distance
    around = np.cross(axis.direction, outwards)
    # turned back by the angle that its position is off around the axis
    seen = np.hstack([np.eye(3), -np.outer(axis.direction, around) / distance])
    turn = np.sqrt(np.linalg.eigvalsh(seen @ C @ seen.T)[-1])
    off = np.sqrt(outwards @ C[PLACE, PLACE] @ outwards)
    return (
        f"its distance from that axis, {1000 * distance:.1f} mm (sigma {1000 * off:.2g} mm)",
        f"how it is tilted and faces, as seen from the axis (sigma {np.rad2deg(turn):.2g} degrees)",
    )


def _in_words(direction: FloatArray) -> str:
    """Write a direction (3,), as an axis' name where it is one."""
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) > 0.98:
        return "xyz"[largest]
    x, y, z = direction * np.sign(direction[largest])
    return f"({x:.2f}, {y:.2f}, {z:.2f})"
