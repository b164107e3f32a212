"""From a robot's file to everything that the rest of the package takes."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.body import FARTHEST, FitError, LinkBody, body_of, whole_arm_error
from pretouch.importing.capsule_fit import MOST
from pretouch.importing.chain import Arm, arm_of
from pretouch.importing.inertials import inertials_of
from pretouch.importing.limits import Limits, limits_of
from pretouch.importing.read import read_source
from pretouch.importing.ready import Ready, check_posture, proposed, rated
from pretouch.importing.sampling import spread
from pretouch.importing.write_mjcf import mjcf_text
from pretouch.robot.description import RobotDescription
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

MJCF = "arm.xml"

_POSTURES, _AROUND = 40, 30
"""Postures in which the whole arm is compared, and places in each."""
_SAME = 1e-9
"""Largest difference of a pose between the source and what is written [m, or of a rotation's entry]."""


@dataclass(frozen=True)
class ImportOptions:
    """What can be said of a robot beside its file."""

    ee: str = ""
    """Link that is the end-effector; by default the likeliest one."""
    name: str = ""
    """Name of the arm; by default the file's."""
    packages: tuple[Path, ...] = ()
    """Folders that hold ROS packages."""
    qd_max: tuple[float, ...] = ()
    """Joint velocity limits [rad/s]: one for all, or one for each."""
    qdd_max: tuple[float, ...] = ()
    """Joint acceleration limits [rad/s^2]."""
    tau_max: tuple[float, ...] = ()
    """Joint torque limits [Nm]."""
    ready: tuple[float, ...] = ()
    """Usual posture to start from [rad]; by default one is searched for."""
    capsules: int = MOST
    """Capsules for one link at most."""
    cover: bool = False
    """Whether capsules are enlarged until no surface sticks out of them."""

    def __post_init__(self) -> None:
        if not 1 <= self.capsules <= 10:
            raise RobotModelError(f"--capsules is {self.capsules}: give 1 to 10 for one link.")


@dataclass(frozen=True, eq=False)
class Imported:
    """An arm that was read, and how good what stands for it is."""

    description: RobotDescription
    """Its `mjcf` is a file of the name `MJCF` that is gone; `mjcf_text` is what was in it."""
    mjcf_text: str
    model: RobotModel
    arm: Arm
    limits: Limits
    bodies: tuple[LinkBody, ...]
    error: FitError
    """Of the whole arm's distances, over many postures."""
    ready: Ready
    remarks: tuple[str, ...]
    """What was assumed or left out, a sentence each."""


def import_robot(file: Path, options: ImportOptions) -> Imported:
    """Read an arm, fit capsules, and propose what the file does not hold. Foreseeable misuse is a RobotModelError."""
    arm = arm_of(read_source(file, options.packages), options.ee)
    limits = limits_of(arm, options.qd_max, options.qdd_max, options.tau_max)
    if options.ready:
        check_posture(np.array(options.ready), limits.q_min, limits.q_max, "--ready")
    bodies, about_bodies = body_of(arm, options.capsules, options.cover)
    inertials, about_inertials = inertials_of(arm, bodies)
    name = options.name or arm.source.name
    text = mjcf_text(name, arm, limits, inertials, bodies)
    with tempfile.TemporaryDirectory(prefix="pretouch-") as folder:
        mjcf = Path(folder) / MJCF
        mjcf.write_text(text, encoding="utf-8")
        middle = (limits.q_min + limits.q_max) / 2
        described = RobotDescription(
            name, mjcf, arm.source.links[arm.ee].name, limits.qd_max, limits.qdd_max, limits.tau_max, middle,
            f"imported from {file.name}",
        )  # fmt: skip
        model = RobotModel(described)
        check_same(arm, model)
        ready, about_ready = (rated(model, np.array(options.ready)), ()) if options.ready else proposed(model)
        described = replace(described, q_ready=ready.q)
        model = RobotModel(described)
    remarks = (*arm.remarks, *limits.remarks, *about_bodies, *about_inertials, *about_ready)
    error = whole_arm_error(arm, bodies, *_checked_at(arm, model))
    return Imported(described, text, model, arm, limits, bodies, error, ready, remarks)


def check_same(arm: Arm, model: RobotModel) -> None:
    """Compare the poses of all links with the source's in several postures; a difference is a RobotModelError."""
    postures = model.q_min + spread(20, model.n) * (model.q_max - model.q_min)
    for q in postures:
        wanted = arm.source.poses(dict(zip((j.name for j in arm.joints), q.tolist(), strict=True)))
        kin = model.kinematics(q)
        for i, link in enumerate(arm.source.links):
            at = model.link_index(link.name)
            off = max(
                float(np.abs(kin.position[at] - wanted[i][:3, 3]).max()),
                float(np.abs(kin.rotation[at] - wanted[i][:3, :3]).max()),
            )
            if not off < _SAME:
                raise RobotModelError(
                    f"The pose of {link.name} in the description differs from the source's by {off:.2g}, so the import"
                    " is faulty: please report it with the file."
                )


def _checked_at(arm: Arm, model: RobotModel) -> tuple[FloatArray, FloatArray]:
    """Postures (S, n), and places (S, P, 3) about the arm in each, base frame."""
    n = model.n
    u = spread(_POSTURES, n)
    half = np.minimum((model.q_max - model.q_min) / 2, np.pi)
    q = model.q_mid + (2 * u - 1) * half
    places = spread(_POSTURES * _AROUND, 4).reshape(_POSTURES, _AROUND, 4)
    found = np.empty((_POSTURES, _AROUND, 3))
    for s, posture in enumerate(q):
        kin = model.kinematics(posture)
        link = model.capsules.link[(places[s, :, 3] * len(model.capsules)).astype(np.int64)]
        found[s] = kin.position[link] + (2 * places[s, :, :3] - 1) * FARTHEST
    return q, found
