"""Forward kinematics by 4 x 4 transforms, twists of the joints, and distances to capsules, in plain NumPy."""

import mujoco
import numpy as np

from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel

ON_AXIS = 1e-9
"""Distance from a capsule's axis below which it gives no direction [m]."""


def rotation_of_quaternion(wxyz: np.ndarray) -> np.ndarray:
    """R (3, 3) of a unit quaternion: v -> v + 2 w (u x v) + 2 u x (u x v)."""
    w, u = wxyz[0], cross_matrix(wxyz[1:])
    return np.eye(3) + 2 * w * u + 2 * u @ u


def cross_matrix(u: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) that multiplies like u x."""
    return np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])


def transform(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """T (4, 4) of a rotation and a position."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


class Posture:
    """An arm at joint positions q (n,): T_O_link (L, 4, 4) of its links, and the twist (n, 4, 4) of each joint."""

    def __init__(self, tree: mujoco.MjModel, q: np.ndarray) -> None:
        self.T = np.tile(np.eye(4), (tree.nbody, 1, 1))
        self.twist = np.zeros((tree.nv, 4, 4))
        self.moves: list[set[int]] = [set() for _ in range(tree.nbody)]
        for link in range(1, tree.nbody):
            parent = tree.body_parentid[link]
            T = self.T[parent] @ transform(rotation_of_quaternion(tree.body_quat[link]), tree.body_pos[link])
            self.moves[link] = set(self.moves[parent])
            for j in range(tree.body_jntadr[link], tree.body_jntadr[link] + tree.body_jntnum[link]):
                u, anchor = cross_matrix(tree.jnt_axis[j]), tree.jnt_pos[j]
                # the velocity field of a turn about the axis: v(p) = u x (p - anchor), first in the link's frame
                field = np.zeros((4, 4))
                field[:3, :3], field[:3, 3] = u, -u @ anchor
                self.twist[j] = T @ field @ np.linalg.inv(T)
                turn = np.eye(3) + np.sin(q[j]) * u + (1 - np.cos(q[j])) * u @ u
                T = T @ transform(turn, anchor - turn @ anchor)
                self.moves[link].add(j)
            self.T[link] = T

    def jacobian(self, link: int, point: np.ndarray) -> np.ndarray:
        """Jacobian (6, n) of a point (3,) of a link, base frame: velocity, then angular velocity."""
        J = np.zeros((6, len(self.twist)))
        for j in self.moves[link]:
            field = self.twist[j]
            J[:3, j] = (field @ np.append(point, 1.0))[:3]
            J[3:, j] = field[2, 1], field[0, 2], field[1, 0]
        return J

    def ends(self, body: Capsules) -> tuple[np.ndarray, np.ndarray]:
        """Ends (C, 3) of the axes of capsules in the base frame."""
        T = self.T[body.link]
        R, p = T[:, :3, :3], T[:, :3, 3]
        return (R @ body.a[:, :, None])[:, :, 0] + p, (R @ body.b[:, :, None])[:, :, 0] + p


def tree_of(model: RobotModel) -> mujoco.MjModel:
    """The arm's tree of bodies and joints, read afresh from its file."""
    return mujoco.MjModel.from_xml_path(str(model.description.mjcf))


def closest(
    point: np.ndarray, a: np.ndarray, b: np.ndarray, radius: np.ndarray, fallback: np.ndarray
) -> tuple[int, np.ndarray, np.ndarray, float]:
    """Which capsule is nearest to a point, the nearest point of its surface, the direction to it, signed distance."""
    axis = b - a
    along = ((point - a) * axis).sum(axis=1) / np.maximum((axis**2).sum(axis=1), 1e-300)
    feet = a + np.clip(along, 0.0, 1.0)[:, None] * axis
    from_axis = np.linalg.norm(point - feet, axis=1)
    c = int(np.argmin(from_axis - radius))
    direction = (point - feet[c]) / from_axis[c] if from_axis[c] > ON_AXIS else fallback
    return c, feet[c] + radius[c] * direction, direction, float(from_axis[c] - radius[c])


def first_hit(p: np.ndarray, rays: np.ndarray, a: np.ndarray, b: np.ndarray, radius: np.ndarray) -> float:
    """Where the first of R unit rays (R, 3) from p (3,) enters one of C capsules: 0 inside, infinite if none does.

    A capsule is two balls and a cylinder with flat ends. Each is convex, so a ray is inside it from one distance on up
    to another; the first to be entered counts. Arrays are (C, R) or (C, R, 3).
    """
    if len(radius) == 0:
        return np.inf
    length = np.linalg.norm(b - a, axis=1)
    axis = (b - a) / np.where(length > 0, length, 1.0)[:, None]
    height = ((p - a) * axis).sum(axis=1)
    rise = axis @ rays.T
    across, sideways = (p - a) - height[:, None] * axis, rays[None] - rise[:, :, None] * axis[:, None]
    straight = np.broadcast_to(rays, sideways.shape)
    parts = [_within(p - a, straight, radius), _within(p - b, straight, radius)]
    enter, leave = _within(across, sideways, radius)
    bottom, top = _between(height[:, None], rise, length[:, None])
    parts.append((np.maximum(enter, bottom), np.minimum(leave, top)))
    return min(_first(enter, leave) for enter, leave in parts)


def _within(offset: np.ndarray, rate: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From and up to which t (C, R) |offset + t rate| <= radius; an empty range (inf, -inf) where never."""
    qa, qb = np.einsum("crk,crk->cr", rate, rate), np.einsum("crk,ck->cr", rate, offset)
    qc = ((offset**2).sum(axis=1) - radius**2)[:, None]
    root = np.sqrt(np.maximum(qb**2 - qa * qc, 0.0))
    still = qa < 1e-24
    with np.errstate(divide="ignore", invalid="ignore"):
        enter, leave = (-qb - root) / qa, (-qb + root) / qa
    always, never = still & (qc <= 0), (still & (qc > 0)) | (~still & (qb**2 < qa * qc))
    enter, leave = np.where(always, -np.inf, enter), np.where(always, np.inf, leave)
    return np.where(never, np.inf, enter), np.where(never, -np.inf, leave)


def _between(height: np.ndarray, rise: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From and up to which t (C, R) 0 <= height + t rise <= length."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ground, roof = -height / rise, (length - height) / rise
    level = np.abs(rise) < 1e-14
    inside = np.where((height >= 0) & (height <= length), -np.inf, np.inf)
    return np.where(level, inside, np.minimum(ground, roof)), np.where(level, -inside, np.maximum(ground, roof))


def _first(enter: np.ndarray, leave: np.ndarray) -> float:
    ahead = (enter <= leave) & (leave >= 0)
    return float(np.maximum(enter[ahead], 0.0).min(initial=np.inf))
