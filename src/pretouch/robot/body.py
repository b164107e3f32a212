"""The body of an arm as capsules fixed to its links."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from pretouch.errors import RobotModelError
from pretouch.groups import CapsuleArrays
from pretouch.types import FloatArray, IntArray


@dataclass(frozen=True)
class Capsules:
    """C capsules: the points within `radius` of the segment from `a` to `b`, in the frame of a link."""

    link: IntArray
    """(C,) index of the link each is fixed to."""
    a: FloatArray
    """(C, 3) one end of the axis, link frame [m]."""
    b: FloatArray
    """(C, 3) other end of the axis, link frame [m]."""
    radius: FloatArray
    """(C,) [m]."""

    def __len__(self) -> int:
        return len(self.radius)

    @cached_property
    def arrays(self) -> CapsuleArrays:
        """The same for compiled code."""
        return CapsuleArrays(self.link, self.a, self.b, self.radius)

    def of_links(self, links: IntArray) -> "Capsules":
        """Return the capsules on the given links, in order."""
        keep = np.isin(self.link, links)
        return Capsules(self.link[keep], self.a[keep], self.b[keep], self.radius[keep])


def no_capsules() -> Capsules:
    """Return none."""
    return Capsules(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


def capsules_of(model: mujoco.MjModel) -> Capsules:
    """Read the capsule geoms of an MJCF model; a link's index is its MuJoCo body id."""
    other = [model.geom(g).name for g in range(model.ngeom) if model.geom_type[g] != mujoco.mjtGeom.mjGEOM_CAPSULE]
    if other:
        raise RobotModelError(f"The geoms {', '.join(other)} are not capsules: describe the body by capsules only.")
    half = np.zeros((model.ngeom, 3))
    for g in range(model.ngeom):
        axis = np.zeros(3)
        mujoco.mju_rotVecQuat(axis, np.array([0.0, 0.0, 1.0]), model.geom_quat[g])
        half[g] = axis * model.geom_size[g, 1]
    return Capsules(
        link=model.geom_bodyid.astype(np.int64),
        a=model.geom_pos - half,
        b=model.geom_pos + half,
        radius=model.geom_size[:, 0].copy(),
    )


def from_axes(points: FloatArray, a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where on axes a to b (C, 3) points (P, 3) are nearest, 0 to 1 (P, C), and the ways from there (P, C, 3) [m].

    `perception.closest.to_axis` is the same for compiled code.
    """
    axis, rel = b - a, points[:, None] - a
    part = np.clip((rel * axis).sum(axis=2) / np.maximum((axis**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return part, rel - part[:, :, None] * axis
