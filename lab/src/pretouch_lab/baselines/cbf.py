"""OSCBF's velocity formulation (Morton, Pavone, IROS 2025): a safety filter of control barrier functions, on cbfpy.

Nothing of their repository is used, which is not packaged; its formulation is written anew: relative degree 1,
alpha(h) = 10 h, soft barriers, an objective in the operational space and its null space. Their spheres are our
capsules, their known obstacles what our units sense, with perception, latencies, contact detection, reaction and joint
box as in `pretouch`. `cbf_barriers` has the mathematics.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pretouch.checks import Positive
from pretouch.control.interface import MotionBody, MotionRequest, Restricted, Restriction
from pretouch.control.task import rotation_error
from pretouch.extras import LAB, Extra
from pretouch.profiles import PROFILES
from pretouch.robot.model import Kinematics
from pretouch.types import WHOLE, FloatArray, Obstacles, RobotState

if TYPE_CHECKING:  # JAX is an extra
    from pretouch_lab.baselines.cbf_barriers import SafetyFilter

CBF = Extra("cbf", ("cbfpy", "elastiqp", "jax"), "cbf", LAB)


@dataclass(frozen=True)
class BarrierFunctions(Restriction):
    """Control barrier functions of joint limits and of what is sensed."""

    gain_1_s: Positive = 10.0
    """Factor alpha of the barriers [1/s], as in all of its authors' examples."""
    margin_m: Positive = 0.01
    """Taken off each distance [m], as `pretouch` does."""

    def on(self, body: MotionBody) -> Restriction:
        """Return the same with the barriers of a body compiled."""
        CBF.need("The filter cbf")
        return _OnBody(self, body)


class _OnBody(Restriction):
    """A `BarrierFunctions` that works for one body."""

    def __init__(self, params: BarrierFunctions, body: MotionBody) -> None:
        self._margin, self._filter = params.margin_m, _compiled(body, params.gain_1_s)

    def step(
        self, state: None, body: MotionBody, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
        request: MotionRequest,
    ) -> tuple[Restricted, None]:  # fmt: skip
        """Return the filter's joint velocities as the only ones there are; an answer that is none is rest."""
        n, model = body.model.n, body.model
        rows = np.zeros((0, n)), np.zeros(0), np.zeros(0, WHOLE)
        if request.hold:
            return Restricted(*rows, weight=1.0), None
        M, J = model.mass_matrix(robot.q), model.ee_jacobian(kin)
        wanted = request.qd
        if wanted is None:
            turn = body.task.orientation_gain_1_s * rotation_error(kin.rotation[model.ee], request.rotation_goal)
            wanted = self._filter.of_twist(M, J, np.concatenate([request.velocity, turn]))
        wanted = np.clip(wanted, -body.limits.qd_max, body.limits.qd_max)
        qd = self._filter(robot.q, wanted, *self._nearest(obstacles), M, J)
        if not np.isfinite(qd).all():
            qd = np.zeros(n)
        return Restricted(*rows, weight=1.0, speeds=(qd, qd)), None

    def _nearest(self, obstacles: Obstacles) -> tuple[FloatArray, FloatArray]:
        """Positions and spreads of the nearest points, filled up with such as are far."""
        from pretouch_lab.baselines.cbf_barriers import MOST, no_points

        o, (point, spread) = obstacles, no_points()
        chosen = np.argsort(o.body_distance, kind="stable")[:MOST]
        from_body = np.einsum("ki,ki->k", o.direction, o.point - o.body_point)
        point[: len(chosen)] = o.point[chosen]
        spread[: len(chosen)] = (from_body - o.body_distance)[chosen] + self._margin
        return point, spread


def _compiled(body: MotionBody, gain: float) -> "SafetyFilter":
    """Compile the filter, once in a process for an arm and its limits: that takes seconds."""
    key = body.model.description.name, gain, body.limits.table.tobytes()
    if key not in _known:
        from pretouch_lab.baselines.cbf_barriers import SafetyFilter

        _known[key] = SafetyFilter(body, gain)
    return _known[key]


_known: dict[tuple[str, float, bytes], "SafetyFilter"] = {}

CBF_PROFILE = replace(PROFILES["pretouch"], name="cbf", approach=BarrierFunctions(), null_space=None)
"""`pretouch` with barrier functions in place of its braking curve."""
