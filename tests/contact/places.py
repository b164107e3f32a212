"""A Panda in some posture, forces at places of its surface, and what the localiser makes of their torques."""

import numpy as np

from pretouch.contact.cues import Cues, no_cues
from pretouch.contact.sequential import LENGTHS
from pretouch.contact.where import WhereState, locate, where_init
from pretouch.contact.where_prior import hidden_places, place_surface
from pretouch.params import LocalisationParams
from pretouch.perception.closest import no_obstacles
from pretouch.robot.description import panda
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.vectors import placed
from pretouch.types import FloatArray, Obstacles, Touched

MODEL = RobotModel(panda())
SURFACE = MODEL.surface
N = MODEL.n
PERIOD = 0.01
SPREAD = np.diag([0.09, 0.12, 0.09, 0.12, 0.01, 0.01, 0.002])
DOUBT = np.full(N, 1e-4)
P = LocalisationParams()


def posture(seed: int = 0) -> Kinematics:
    q = MODEL.description.q_ready + np.random.default_rng(seed).uniform(-0.3, 0.3, N)
    return MODEL.kinematics(q)


def place(kin: Kinematics, c: int) -> tuple[FloatArray, FloatArray]:
    link = SURFACE.link[c]
    return kin.position[link] + kin.rotation[link] @ SURFACE.point[c], kin.rotation[link] @ SURFACE.normal[c]


def exposed(kin: Kinematics) -> FloatArray:
    """Which places (N,) nothing hides."""
    at, outwards = np.empty((len(SURFACE), 3)), np.empty((len(SURFACE), 3))
    hidden = np.empty(len(SURFACE), np.bool_)
    place_surface(kin.position, kin.rotation, SURFACE.link, SURFACE.point, SURFACE.normal, at, outwards)
    a, b = placed(MODEL.capsules, kin)
    hidden_places(at, SURFACE.body, MODEL.rigid[MODEL.capsules.link], a, b, MODEL.capsules.radius, hidden)
    return ~hidden


def torques(kin: Kinematics, *contacts: tuple[int, float]) -> FloatArray:
    total = np.zeros(N)
    for c, size in contacts:
        point, normal = place(kin, c)
        total += MODEL.jacobian(kin, int(SURFACE.link[c]), point)[:3].T @ (-size * normal)
    return total


def said(
    kin: Kinematics, torque: FloatArray, obstacles: Obstacles | None = None, cues: Cues | None = None, steps: int = 1,
    evidence: float = 5.0, p: LocalisationParams = P, state: WhereState | None = None,
) -> tuple[Touched, WhereState]:  # fmt: skip
    means = np.tile(torque, (len(LENGTHS), 1))
    state, found = where_init() if state is None else state, None
    for _ in range(steps):
        found, state = locate(
            state, MODEL, kin, means, 32, SPREAD + np.diag(DOUBT), DOUBT, evidence, np.zeros(N),
            no_obstacles() if obstacles is None else obstacles,
            no_cues(len(MODEL.links)) if cues is None else cues, PERIOD, p,
        )  # fmt: skip
    assert found is not None
    return found, state


def of(name: str, kin: Kinematics) -> int:
    """Return a place in the middle of a link that nothing hides."""
    own = np.flatnonzero((SURFACE.link == MODEL.link_index(name)) & exposed(kin))
    return int(own[len(own) // 2])
