"""What truly happened between arm and obstacle in a trial, step by step: no sensor is asked."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.avoidance.obstacle import Nearest, Shape, nearest
from pretouch_lab.trial import Record


@dataclass(frozen=True)
class Truth:
    """S control steps."""

    nearest: list[Nearest]
    """True closest points of arm and obstacle at each step."""
    distance: FloatArray
    """(S,) distance of the surfaces, negative in contact [m]."""
    ee_distance: FloatArray
    """(S,) distance of the obstacle's surface from the end-effector's origin [m]."""


def truth_of(record: Record, model: RobotModel, shapes: Iterable[Shape]) -> Truth:
    """Work out from true joint positions and the obstacle's true place at each step how near they were."""
    found, of_ee = [], []
    for step, shape in zip(record.steps, shapes, strict=True):
        kin = model.kinematics(step.q)
        found.append(nearest(kin, model.body, shape))
        of_ee.append(float(shape.closest(kin.position[model.ee])[0]))
    return Truth(found, np.array([n.distance for n in found]), np.array(of_ee))
