"""A posture to start from: hand in front and pointing down, away from limits, singularities and the arm itself."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import (
    Reaching,
    capsule_ends,
    ever_apart,
    kinematics_of,
    posture_at,
    self_distances,
    spread,
)
from pretouch.types import BoolArray, FloatArray

_STARTS = 96
_DRAWN, _FREE = Reaching(80, 0.2, 1e-3, 0.02), Reaching(80, 0.2, 1e-6)
"""First drawn to the middle of the joints' ranges; arms with small singular values get there only undrawn."""
_ANYWHERE = 1000
"""Postures that are looked at where no hand in front of the base points down."""
_IN_FRONT, _HEIGHT = 0.55, 0.4
"""Where the hand is to be, in front of the base and above it, as parts of the arm's reach."""
_CLEAR = 0.01
"""Least distance of the arm from itself and of its moving parts from the base's plane [m]."""
_MARGIN = 0.1
"""Least distance of each joint from its limits, of its range or of two turns."""


@dataclass(frozen=True, eq=False)
class Ready:
    """A posture and what it is good for."""

    q: FloatArray
    """(n,) [rad]."""
    singular_value: float
    """Smallest singular value of the Jacobian [m or 1 per rad]; 0 is singular."""
    clear: float
    """Distance of the arm from itself [m]; negative where its capsules are in each other."""
    nearest: tuple[str, str] | None
    """The two links with that distance; None if no two come apart."""

    @property
    def conflict(self) -> str | None:
        """Say what is wrong with the posture, if the arm touches itself there."""
        if self.clear > 0 or self.nearest is None:
            return None
        first, second = self.nearest
        return (
            f"In the ready posture the capsules of {first} and {second} overlap by {-1000 * self.clear:.0f} mm: choose"
            " another posture, or smaller capsules in arm.xml."
        )


def reach_of(model: RobotModel) -> float:
    """Farthest that the end-effector comes from the base frame's vertical axis [m], in a thousand postures."""
    low, high = _near_middle(model, 1.0)
    q = low + spread(1000, model.n) * (high - low)
    places = np.array([model.kinematics(row).position[model.ee] for row in q])
    return float(np.linalg.norm(places[:, :2], axis=1).max())


def check_posture(q: FloatArray, q_min: FloatArray, q_max: FloatArray, what: str) -> None:
    """Refuse a posture outside the limits (n,) [rad], or of another size, with a RobotModelError that begins `what`."""
    if q.shape != q_min.shape or not np.all((q >= q_min) & (q <= q_max)):
        limits = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(q_min, q_max, strict=True))
        raise RobotModelError(
            f"{what} is {np.round(q, 4).tolist()}: give {len(q_min)} joint positions [rad] within {limits}."
        )


def rated(model: RobotModel, q: FloatArray, apart: BoolArray | None = None) -> Ready:
    """Say what a posture (n,) within the limits is good for."""
    values = np.linalg.svd(model.ee_jacobian(model.kinematics(q)), compute_uv=False)
    apart = ever_apart(model) if apart is None else apart
    clear, nearest = np.inf, None
    if apart.any():
        between = self_distances(model, capsule_ends(model, kinematics_of(model, q[None])))[0, apart]
        at = int(between.argmin())
        first, second = (model.links[model.capsules.link[c]] for c in model.apart[apart][at])
        clear, nearest = float(between[at]), (first, second)
    return Ready(q, float(values[-1]), clear, nearest)


def proposed(model: RobotModel, remarks: list[str]) -> Ready:
    """Search for a good posture. Where none has its hand in front and pointing down, a remark says so."""
    reach, (low, high) = reach_of(model), _near_middle(model, 0.8)
    hand, apart = np.array([_IN_FRONT * reach, 0.0, _HEIGHT * reach]), ever_apart(model, _CLEAR)

    def to_hand(kin: Kinematics) -> FloatArray:
        """Motion (6,) that brings the end-effector to its place, pointing down."""
        direction = pointing(model, kin)
        turn = np.cross(direction, [0.0, 0.0, -1.0]) if direction[2] <= 0.999 else np.array([1.0, 0.0, 0.0])
        return np.concatenate([hand - kin.position[model.ee], turn])

    for way in (_DRAWN if model.n > 5 else _FREE, _FREE):
        starts = low + spread(_STARTS, model.n) * (high - low)
        reached = [posture_at(model, q, to_hand, model.q_mid, way) for q in starts]
        postures = [rated(model, q, apart) for q in reached if q is not None and _room(model, q) > _MARGIN]
        best = max(postures, key=partial(_grade, model), default=None)
        if best and _grade(model, best)[0]:
            return best
    remarks.append(
        "No posture was found with the hand in front of the base and pointing down, so another one was used: give"
        " yours with --ready, or as q_ready in robot.toml."
    )
    postures = [rated(model, low + u * (high - low), apart) for u in spread(_ANYWHERE, model.n)]
    return max(postures, key=partial(_grade, model))


def _grade(model: RobotModel, ready: Ready) -> tuple[bool, float, bool, float]:
    """Rate a posture, the best highest: clear of itself and of the base's plane, and by how much; then lifted.

    That is one whose body, but for what the first joint alone moves, stays above that plane.
    """
    clear = ready.clear >= _CLEAR and model.kinematics(ready.q).position[model.body.link, 2].min() >= _CLEAR
    ends = capsule_ends(model, kinematics_of(model, ready.q[None]))[0]
    upper = model.moved_by[model.capsules.link].sum(axis=1) > 1
    lowest = (ends[upper][..., 2] - model.capsules.radius[upper, None]).min(initial=np.inf)
    value = ready.singular_value + 0.2 * _room(model, ready.q)
    return bool(clear), min(ready.clear, _CLEAR), bool(lowest >= _CLEAR), value


def _near_middle(model: RobotModel, part: float) -> tuple[FloatArray, FloatArray]:
    """Part of each joint's range about its middle, of half a turn to either side at most."""
    half = np.minimum((model.q_max - model.q_min) / 2, np.pi) * part
    return model.q_mid - half, model.q_mid + half


def _room(model: RobotModel, q: FloatArray) -> float:
    """Least distance of a joint from its limits, as a part of half its range, of half a turn at most."""
    half = np.minimum((model.q_max - model.q_min) / 2, np.pi)
    return float((np.minimum(q - model.q_min, model.q_max - q) / half).min())


def pointing(model: RobotModel, kin: Kinematics) -> FloatArray:
    """Return the direction (3,) the hand points in: along the last joint, or away from it if the hand is beside it."""
    axis, out = kin.axis[-1], kin.position[model.ee] - kin.anchor[-1]
    away = float(np.linalg.norm(out))
    if away > 0.01 and abs(axis @ out) < away / 2:
        return out / away
    return axis if axis @ out >= 0 else -axis
