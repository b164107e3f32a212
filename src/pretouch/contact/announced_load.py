"""A load that a program announces: what it does to the external torques and the force is taken out before detection.

When it comes is known to `Payload.within_s` only, and an object on a table comes bit by bit. For so long any part of
the change from the load before is taken out, the part that leaves least of the torques. Then all of it is, and
a detector that learns free motion doubts it.
"""

from dataclasses import replace

import numpy as np

from pretouch.contact.residual_model import ResidualModel
from pretouch.params import SequentialParams
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, Payload, RobotState
from pretouch.values import value

_NOTHING = Payload(0.0)
_GRAVITY = np.array([0.0, 0.0, 9.81])
_OBSERVER_1_S = SequentialParams().observer_gain_1_s
_MASS_PART, _OFF_M = 0.05, 0.02
"""Deviations of what is announced: of the mass, as a part of it, and of the centre [m]."""
_BEYOND = 2.0 * _MASS_PART
"""What part of the change beyond nothing and all of it passes while it is awaited."""


@value
class LoadState:
    """What was announced, and how it comes. Recordings keep these names."""

    payload: Payload
    before: Payload
    """What was carried before it."""
    waited: float
    """Time since it was announced [s]."""
    twist: FloatArray | None
    """(6,) commanded velocity of the end-effector, as late as the torques [m/s, rad/s]; None before the first step."""
    free: FloatArray
    """(n,) torques of free motion without a load, by the detector in the step before [Nm]."""
    doubted_kg: float = 0.0
    """How much it changes from this step on, not to be awaited any more [kg]; 0 in all other steps."""


def announced(state: LoadState | None, said: Payload | None, robot: RobotState) -> LoadState | None:
    """Return what is known of the load once a payload was given; None: nothing was said, and what was said stays."""
    if said is None or (state is not None and said == state.payload):
        return state
    if state is None:
        return LoadState(said, _NOTHING, 0.0, None, np.zeros(len(robot.q)))
    return replace(state, payload=said, before=state.payload, waited=0.0)


def without_load(
    state: LoadState, model: RobotModel, kin: Kinematics, robot: RobotState, period: float
) -> tuple[RobotState, LoadState]:
    """Return a robot's state with the load taken out of its torques and force, and what to remember."""
    keep, J, R = np.exp(-_OBSERVER_1_S * period), model.ee_jacobian(kin), kin.rotation[model.ee]
    twist = J @ robot.qd_commanded
    before = twist if state.twist is None else state.twist
    twist = keep * before + (1.0 - keep) * twist
    # by differences, so that a path's bend is in it: at 1 m/s it throws a load outwards by a fifth of its weight
    acceleration = (twist - before) / period
    load, within = wrench_of(state.payload, R, acceleration), state.payload.within_s
    if state.waited < within:
        earlier = wrench_of(state.before, R, acceleration)
        load = earlier + _share(J, robot, state.free + J.T @ earlier, load - earlier) * (load - earlier)
    waited = state.waited + period
    # doubted only now: while any part of it passed, the torques taught nothing of the mass
    changed = abs(state.payload.mass_kg - state.before.mass_kg) if state.waited < within <= waited else 0.0
    wrench = None if robot.wrench is None else robot.wrench - load
    after = replace(state, waited=waited, twist=twist, doubted_kg=changed)
    return replace(robot, tau_ext=robot.tau_ext - J.T @ load, wrench=wrench), after


def wrench_of(payload: Payload, R: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return force and torque (6,) of a load on the arm, about the end-effector's origin [N, Nm], base frame.

    The end-effector has the orientation R (3, 3) and the acceleration (6,) [m/s^2, rad/s^2].
    """
    lever = R @ np.array(payload.com_m)
    force = -payload.mass_kg * (_GRAVITY + acceleration[:3] + np.cross(acceleration[3:], lever))
    return np.concatenate([force, np.cross(lever, force)])


def _share(J: FloatArray, robot: RobotState, torque: FloatArray, change: FloatArray) -> float:
    """Return how much of the change of a wrench (6,) explains the torques beyond those (n,) without it best."""
    measured, expected = robot.tau_ext, J.T @ change
    if np.isnan(measured).any():  # a detector by the force needs no torques
        measured = torque if robot.wrench is None else J.T @ robot.wrench
    # least squares; nothing of the change where it is none
    size = float(expected @ expected)
    part = float(expected @ (measured - torque)) / size if size > 0.0 else 0.0
    return min(max(part, -_BEYOND), 1.0 + _BEYOND)


def kept_free(state: LoadState, torque: FloatArray, residual: FloatArray) -> LoadState:
    """Keep what a detector takes for free motion: torques (n,) without the load less its residual (n,) [Nm]."""
    free = torque - residual
    return state if np.isnan(free).any() else replace(state, free=free)


def doubted(model: ResidualModel, kg: float) -> ResidualModel:
    """Return a model of free motion that doubts a load of which so much is new [kg]."""
    covariance = model.covariance.copy()
    covariance[:, 0, 0] += (kg * _GRAVITY[2] * _OFF_M) ** 2
    covariance[:, -1, -1] += (kg * _MASS_PART) ** 2
    return model._replace(covariance=covariance)


def most_kg(model: RobotModel) -> float:
    """Return the load that the joints can hold in the arm's ready posture [kg], its own weight aside."""
    levers = model.ee_jacobian(model.kinematics(model.description.q_ready))[:3].T @ _GRAVITY
    return float((model.description.tau_max / np.maximum(np.abs(levers), 1e-9)).min())
