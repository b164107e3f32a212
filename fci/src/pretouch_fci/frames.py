"""Frames and loads at the flange, as the robot's interface knows and lets set them."""

from dataclasses import dataclass, field

import numpy as np

from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import FloatArray
from pretouch_fci.inertia import Inertial, hand_of

_ROTATION_SLACK = 1e-3


def pose(kin: Kinematics, link: int) -> FloatArray:
    """Pose T_O_link (4, 4) of a link."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = kin.rotation[link], kin.position[link]
    return T


def pose_of(columns: FloatArray) -> FloatArray | None:
    """Read a pose (4, 4) from the sixteen numbers of a request, column by column; None if it is none."""
    T = np.array(columns).reshape(4, 4).T
    if not np.all(np.isfinite(T)) or np.any(T[3] != (0.0, 0.0, 0.0, 1.0)):
        return None
    R = T[:3, :3]
    proper = np.allclose(R @ R.T, np.eye(3), atol=_ROTATION_SLACK) and np.linalg.det(R) > 0
    return T if proper else None


def flange_of(model: RobotModel) -> int:
    """Index of the flange: the last link before the hand, which carries the end-effector."""
    name = next((name for name in model.links if name.endswith("link8")), None)
    return model.ee if name is None else model.link_index(name)


@dataclass
class Frames:
    """Where end-effector and stiffness frame are on the flange, and what the flange carries."""

    flange: int
    """Index of the flange's link."""
    F_T_NE: FloatArray
    """(4, 4) nominal end-effector on the flange."""
    hand: Inertial
    """End-effector, in the flange's frame."""
    NE_T_EE: FloatArray = field(default_factory=lambda: np.eye(4))
    """(4, 4) end-effector on the nominal one."""
    EE_T_K: FloatArray = field(default_factory=lambda: np.eye(4))
    """(4, 4) stiffness frame, in which the external wrench acts, on the end-effector."""
    load: Inertial = field(default_factory=lambda: Inertial(0.0, np.zeros(3), np.zeros((3, 3))))
    """What the client says that the hand carries, in the flange's frame."""

    @property
    def F_T_EE(self) -> FloatArray:
        """(4, 4) end-effector on the flange."""
        return self.F_T_NE @ self.NE_T_EE


def frames_of(model: RobotModel) -> Frames:
    """Return the frames of an arm as delivered: the end-effector is the model's."""
    kin, flange = model.kinematics(model.description.q_ready), flange_of(model)
    return Frames(flange, np.linalg.inv(pose(kin, flange)) @ pose(kin, model.ee), hand_of(model, flange))
