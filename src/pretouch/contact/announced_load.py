"""A load that a program announces: its part of the external torques and the force is removed before detection.

Its time is known to `Payload.within_s` only, and an object on a table is lifted gradually. For that time a part of the
change from the load before is removed: the part that leaves the smallest torques. After that all of it is removed, and
a detector that learns free motion widens its uncertainty.
"""

from dataclasses import replace

import numpy as np

from pretouch.contact.residual_model import ResidualModel
from pretouch.params import SequentialParams
from pretouch.robot.kinematics import G_M_S2, Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, Payload, RobotState
from pretouch.values import value

_NOTHING = Payload(0.0)
_OBSERVER_1_S = SequentialParams().observer_gain_1_s
_MASS_PART, _OFF_M = 0.05, 0.02
"""Standard deviations of an announcement: of the mass, as a part of it, and of the centre [m]."""
_BEYOND = 2.0 * _MASS_PART
"""Part of the change below 0 and above 1 that is accepted during the wait."""


@value
class LoadState:
    """An announced load, and its arrival. Recordings store these names."""

    payload: Payload
    before: Payload
    """Load before it."""
    waited: float
    """Time since the announcement [s]."""
    twist: FloatArray | None
    """(6,) commanded velocity of the end-effector, delayed as the torques [m/s, rad/s]; None before the first step."""
    free: FloatArray
    """(n,) torques of free motion without the load, by the detector in the step before [Nm]."""
    doubted_kg: float = 0.0
    """Change of the mass in the step that ends the wait [kg]; 0 in all other steps."""


def announce(state: LoadState | None, payload: Payload | None, robot: RobotState) -> LoadState | None:
    """Return the state after an announcement; without one, for None, the state stays."""
    if payload is None or (state is not None and payload == state.payload):
        return state
    if state is None:
        return LoadState(payload, _NOTHING, 0.0, None, np.zeros(len(robot.q)))
    return replace(state, payload=payload, before=state.payload, waited=0.0)


def without_load(
    state: LoadState, model: RobotModel, kin: Kinematics, robot: RobotState, period: float
) -> tuple[RobotState, LoadState]:
    """Return a robot's state without the load in its torques and force, and the state of the load."""
    keep, J, R = np.exp(-_OBSERVER_1_S * period), model.ee_jacobian(kin), kin.rotation[model.ee]
    twist = J @ robot.qd_commanded
    before = twist if state.twist is None else state.twist
    twist = keep * before + (1.0 - keep) * twist
    # by differences, so that it includes the bend of a path: at 1 m/s that adds a fifth of the load's weight
    acceleration = (twist - before) / period
    acceleration[:3] -= model.gravity
    load, within = wrench_of(state.payload, R, acceleration), state.payload.within_s
    if state.waited < within:
        earlier = wrench_of(state.before, R, acceleration)
        load = earlier + _share(J, robot, state.free + J.T @ earlier, load - earlier) * (load - earlier)
    waited = state.waited + period
    # only now: during the wait, the torques said nothing about the mass
    changed = abs(state.payload.mass_kg - state.before.mass_kg) if state.waited < within <= waited else 0.0
    wrench = None if robot.wrench is None else robot.wrench - load
    after = replace(state, waited=waited, twist=twist, doubted_kg=changed)
    return replace(robot, tau_ext=robot.tau_ext - J.T @ load, wrench=wrench), after


def wrench_of(payload: Payload, R: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return force and torque (6,) of a load on the arm, about the end-effector's origin [N, Nm], base frame.

    The end-effector has the orientation R (3, 3) and the proper acceleration (6,), at rest that against gravity
    [m/s^2, rad/s^2].
    """
    lever = R @ np.array(payload.com_m)
    force = -payload.mass_kg * (acceleration[:3] + np.cross(acceleration[3:], lever))
    return np.concatenate([force, np.cross(lever, force)])


def _share(J: FloatArray, robot: RobotState, torque: FloatArray, change: FloatArray) -> float:
    """Return the part of a change of the wrench (6,) that best explains the torques beyond those (n,) without it."""
    measured, expected = robot.tau_ext, J.T @ change
    if np.isnan(measured).any():  # a detector that uses the force needs no torques
        measured = torque if robot.wrench is None else J.T @ robot.wrench
    # least squares; 0 for a change of 0
    size = float(expected @ expected)
    part = float(expected @ (measured - torque)) / size if size > 0.0 else 0.0
    return min(max(part, -_BEYOND), 1.0 + _BEYOND)


def store_free_torques(state: LoadState, torque: FloatArray, residual: FloatArray) -> LoadState:
    """Store the torques of free motion: those (n,) without the load less the detector's residual (n,) [Nm]."""
    free = torque - residual
    return state if np.isnan(free).any() else replace(state, free=free)


def widen_for_load(model: ResidualModel, kg: float) -> ResidualModel:
    """Return a model of free motion with the uncertainty of a load whose mass has changed [kg]."""
    covariance = model.covariance.copy()
    covariance[:, 0, 0] += (kg * G_M_S2 * _OFF_M) ** 2
    covariance[:, -1, -1] += (kg * _MASS_PART) ** 2
    return model._replace(covariance=covariance)


def most_kg(model: RobotModel) -> float:
    """Return the load that the joints can hold in the arm's ready posture [kg], its own weight aside."""
    levers = model.ee_jacobian(model.kinematics(model.description.q_ready))[:3].T @ model.gravity
    return float((model.description.tau_max / np.maximum(np.abs(levers), 1e-9)).min())
