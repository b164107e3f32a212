"""A posture to start from: hand in front and pointing down, away from limits, singularities and the arm itself."""

from dataclasses import dataclass

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.sampling import spread
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import capsule_ends, kinematics_of, self_distances
from pretouch.types import BoolArray, FloatArray

_STARTS, _STEPS, _STEP_MAX = 96, 80, 0.2
_TRIED = 100
_IN_FRONT, _HEIGHT = 0.55, 0.4
"""Where the hand is to be, in front of the base and above it, as parts of the arm's reach."""
_CLEAR = 0.02
"""Least distance of the arm from itself and of its moving parts from the base's plane [m]."""
_MARGIN = 0.1
"""Least distance of each joint from its limits, of its range or of two turns."""


@dataclass(frozen=True, eq=False)
class Ready:
    """A posture and what it is good for."""

    q: FloatArray
    """(n,) [rad]."""
    manipulability: float
    """Yoshikawa's, sqrt(det(J J^T)) of the hand's position and orientation; of a Panda's usual posture about 0.08."""
    singular_value: float
    """Smallest singular value of the Jacobian [m or 1 per rad]; 0 is singular."""
    clear: float
    """Distance of the arm from itself [m]."""


def reach_of(model: RobotModel) -> float:
    """Farthest that the end-effector comes from the base frame's vertical axis [m], in a thousand postures."""
    low, high = _near_middle(model, 1.0)
    q = low + spread(1000, model.n) * (high - low)
    places = np.array([model.kinematics(row).position[model.ee] for row in q])
    return float(np.linalg.norm(places[:, :2], axis=1).max())


def rated(model: RobotModel, q: FloatArray, apart: BoolArray | None = None) -> Ready:
    """Say what a posture is good for; one outside the limits, or of another size, is a RobotModelError."""
    if q.shape != (model.n,) or not np.all((q >= model.q_min) & (q <= model.q_max)):
        limits = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(model.q_min, model.q_max, strict=True))
        raise RobotModelError(
            f"--ready is {np.round(q, 4).tolist()}: give {model.n} joint positions [rad] within {limits}."
        )
    values = np.linalg.svd(model.ee_jacobian(model.kinematics(q)), compute_uv=False)
    return Ready(q, float(np.prod(values)) if model.n >= 6 else 0.0, float(values[-1]), _clearance(model, q, apart))


def proposed(model: RobotModel) -> Ready:
    """Search for a good posture; a RobotModelError asks for one where none is found."""
    reach = reach_of(model)
    hand = np.array([_IN_FRONT * reach, 0.0, _HEIGHT * reach])
    low, high = _near_middle(model, 0.8)
    apart = ever_apart(model)
    best, best_score = None, -np.inf
    for u in spread(_STARTS, model.n):
        q = _reaching(model, low + u * (high - low), hand)
        if q is None:
            continue
        found = rated(model, q, apart)
        kin = model.kinematics(q)
        lowest = (kin.position[model.body.link, 2]).min()
        if found.clear < _CLEAR or lowest < _CLEAR:
            continue
        score = found.singular_value + 0.2 * _room(model, q)
        if score > best_score:
            best, best_score = found, score
    if best is None:
        raise RobotModelError(
            f"{model.description.name}: no posture was found with the hand in front of the base and pointing down:"
            " give one by --ready, one position a joint [rad], by commas."
        )
    return best


def _near_middle(model: RobotModel, part: float) -> tuple[FloatArray, FloatArray]:
    """Part of each joint's range about its middle, of half a turn to either side at most."""
    half = np.minimum((model.q_max - model.q_min) / 2, np.pi) * part
    return model.q_mid - half, model.q_mid + half


def _room(model: RobotModel, q: FloatArray) -> float:
    """Least distance of a joint from its limits, as a part of half its range, of half a turn at most."""
    half = np.minimum((model.q_max - model.q_min) / 2, np.pi)
    return float((np.minimum(q - model.q_min, model.q_max - q) / half).min())


def pointing(model: RobotModel, q: FloatArray) -> FloatArray:
    """Return the direction (3,) the hand points in: along the last joint, or away from it if the hand is beside it."""
    kin = model.kinematics(q)
    axis, out = kin.axis[-1], kin.position[model.ee] - kin.anchor[-1]
    away = float(np.linalg.norm(out))
    if away > 0.01 and abs(axis @ out) < away / 2:
        return out / away
    return axis if axis @ out >= 0 else -axis


def _reaching(model: RobotModel, q: FloatArray, hand: FloatArray) -> FloatArray | None:
    """Bring the end-effector to a place (3,) pointing down, from a posture; None where that does not come about."""
    n = model.n
    for _ in range(_STEPS):
        kin = model.kinematics(q)
        turn = np.cross(pointing(model, q), [0.0, 0.0, -1.0])
        if pointing(model, q)[2] > 0.999:
            turn = np.array([1.0, 0.0, 0.0])
        error = np.concatenate([hand - kin.position[model.ee], turn])
        if np.abs(error).max() < 1e-4:
            return q if _room(model, q) > _MARGIN else None
        J = model.ee_jacobian(kin)
        pull = 0.02 * (model.q_mid - q) if n > 5 else np.zeros(n)
        pseudo = J.T @ np.linalg.inv(J @ J.T + 1e-3 * np.eye(6))
        step = pseudo @ error + (np.eye(n) - pseudo @ J) @ pull
        q = np.clip(q + step * min(1.0, _STEP_MAX / max(np.abs(step).max(), 1e-12)), model.q_min, model.q_max)
    return None


def _clearance(model: RobotModel, q: FloatArray, apart: BoolArray | None = None) -> float:
    """Least distance of the arm from itself [m], but for parts that never come apart."""
    apart = ever_apart(model) if apart is None else apart
    ends = capsule_ends(model, kinematics_of(model, q[None]))
    return float(self_distances(model, ends)[0, apart].min(initial=np.inf))


def ever_apart(model: RobotModel) -> BoolArray:
    """Whether the pairs (P,) of `pairs_apart` come apart in some of many postures: in a short wrist not all do."""
    q = model.q_min + spread(_TRIED, model.n) * (model.q_max - model.q_min)
    ends = capsule_ends(model, kinematics_of(model, q))
    return np.asarray(np.any(self_distances(model, ends) > 0, axis=0))
