"""A Panda in some posture, forces at candidate points of its surface, and what localisation makes of their torques."""

import numpy as np

from pretouch.contact.cues import Cues, no_cues
from pretouch.contact.localisation.localise import LocalisationState, localisation_init, localise
from pretouch.contact.localisation.prior import candidate_poses, hidden_candidates
from pretouch.contact.sequential_detector import Observation, ResidualWindows
from pretouch.contact.window_scatter import LENGTHS
from pretouch.groups import Kinematics
from pretouch.params import LocalisationParams
from pretouch.perception.closest import no_obstacles
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.robot.vectors import placed_capsules
from pretouch.types import FloatArray, Obstacles, RobotState, Touched

MODEL = RobotModel(panda())
SURFACE = MODEL.surface
N = MODEL.n
PERIOD = 0.01
NOISE = np.diag([0.09, 0.12, 0.09, 0.12, 0.01, 0.01, 0.002])
MODEL_VARIANCE = np.full(N, 1e-4)
P = LocalisationParams()


def posture(seed: int = 0) -> Kinematics:
    q = MODEL.description.q_ready + np.random.default_rng(seed).uniform(-0.3, 0.3, N)
    return MODEL.kinematics(q)


def pose_of(kin: Kinematics, c: int) -> tuple[FloatArray, FloatArray]:
    """Return a candidate's point and normal in the base frame."""
    link = SURFACE.link[c]
    return kin.position[link] + kin.rotation[link] @ SURFACE.point[c], kin.rotation[link] @ SURFACE.normal[c]


def poses(kin: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Return points and normals (N, 3) of all candidates in the base frame."""
    point, normal = np.empty((len(SURFACE), 3)), np.empty((len(SURFACE), 3))
    candidate_poses(kin, SURFACE.arrays, point, normal)
    return point, normal


def exposed(kin: Kinematics) -> FloatArray:
    """Which candidates (N,) nothing hides."""
    capsules, hidden = placed_capsules(MODEL.capsules.arrays, kin), np.empty(len(SURFACE), np.bool_)
    hidden_candidates(poses(kin)[0], SURFACE.body, capsules, MODEL.rigid[capsules.link], hidden)
    return ~hidden


def torques(kin: Kinematics, *contacts: tuple[int, float]) -> FloatArray:
    total = np.zeros(N)
    for c, size in contacts:
        point, normal = pose_of(kin, c)
        total += MODEL.jacobian(kin, int(SURFACE.link[c]), point)[:3].T @ (-size * normal)
    return total


def said(
    kin: Kinematics, torque: FloatArray, obstacles: Obstacles | None = None, cues: Cues | None = None, steps: int = 1,
    ratio: float = 5.0, p: LocalisationParams = P, state: LocalisationState | None = None,
) -> tuple[Touched, LocalisationState]:  # fmt: skip
    windows = ResidualWindows(np.tile(torque, (len(LENGTHS), 1)), 32, NOISE + np.diag(MODEL_VARIANCE), MODEL_VARIANCE)
    robot = RobotState(0.0, np.zeros(N), np.zeros(N), np.zeros(N), np.zeros(N), torque, None)
    seen = Observation(
        kin, robot, no_obstacles() if obstacles is None else obstacles,
        no_cues(len(MODEL.links)) if cues is None else cues,
    )  # fmt: skip
    state, found = localisation_init() if state is None else state, None
    for _ in range(steps):
        found, state = localise(state, MODEL, seen, windows, ratio, PERIOD, p)
    assert found is not None
    return found, state


def of(name: str, kin: Kinematics) -> int:
    """Return a candidate in the middle of a link that nothing hides."""
    own = np.flatnonzero((SURFACE.link == MODEL.link_index(name)) & exposed(kin))
    return int(own[len(own) // 2])
