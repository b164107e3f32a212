"""Free motion of an arm made by equations of motion, without the simulator: sines, an observer, and known errors."""

from dataclasses import dataclass, field
from functools import cache

import numpy as np

from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sim.observer import observe, observer_init
from pretouch.sim.plant_params import PlantParams
from pretouch_lab.identification.identify import IdentifiedArm, Quantity
from pretouch_lab.identification.recording import ArmSamples

MODEL = RobotModel(panda())
PLANT = PlantParams()
USUAL = PLANT
FRICTION = 0.8 * np.array(PLANT.friction_f1_nm)
"""What is not compensated of it in an arm as made below [Nm]."""


@dataclass(frozen=True)
class Made:
    """Errors of an arm of seven joints."""

    offset: np.ndarray = field(default_factory=lambda: np.array([0.3, -0.4, 0.2, 0.1, -0.1, 0.05, 0.02]))
    friction: float = 0.8
    """Part of the usual friction that is not compensated."""
    ripple: np.ndarray = field(default_factory=lambda: np.array([0.2, 0.2, 0.1, 0.1, 0.05, 0.05, 0.05]))
    payload: float = 0.15
    gain: float = 45.0
    velocity_noise: float = 0.01
    torque_noise: float = 0.2
    push: tuple[float, float] = (0.0, 0.0)
    """From when to when 8 Nm push joint 2 [s]."""


def free_motion(made: Made = Made(), seconds: float = 60.0, seed: int = 5, every: int = 10) -> ArmSamples:
    """Samples at 1 kHz / `every`."""
    rng, n, dt = np.random.default_rng(seed), MODEL.n, 0.001
    rate = 2 * np.pi * np.array([0.11, 0.13, 0.17, 0.19, 0.23, 0.29, 0.31])
    t = dt * np.arange(round(seconds / dt))[:, None]
    middle = np.array([0.0, 0.2, 0.0, -1.8, 0.0, 2.0, 0.5])
    q = middle + 0.5 * np.sin(rate * t)
    qd, qdd = 0.5 * rate * np.cos(rate * t), -0.5 * rate**2 * np.sin(rate * t)
    measured = qd + made.velocity_noise * rng.standard_normal(q.shape)
    f1, f2, f3 = (np.array(x) for x in (PLANT.friction_f1_nm, PLANT.friction_f2_s_rad, PLANT.friction_f3_rad_s))
    lost = made.friction * f1 * (1 / (1 + np.exp(-f2 * (qd + f3))) - 1 / (1 + np.exp(-f2 * f3)))
    keep = np.exp(-2 * np.pi * PLANT.torque_noise_hz * dt)
    noise, drive = np.zeros(n), made.torque_noise * np.sqrt(1 - keep**2) * rng.standard_normal(q.shape)
    state, rows = observer_init(MODEL.mass_matrix(q[0]), measured[0]), []
    for i in range(len(q)):
        kin = MODEL.kinematics(q[i])
        M, bias = MODEL.mass_matrix_and_bias(q[i], qd[i], np.empty(n))
        J = MODEL.ee_jacobian(kin)[:3]
        tau = M @ qdd[i] + bias + lost[i] + made.payload * J.T @ np.array([0, 0, 9.81])
        noise = keep * noise + drive[i]
        sensed = tau + made.offset + made.ripple * np.sin(np.array(PLANT.ripple_cycles) * q[i] + 0.7) + noise
        if made.push[0] <= t[i, 0] < made.push[1]:
            sensed[1] -= 8.0
        _, bias = MODEL.mass_matrix_and_bias(q[i], measured[i], np.empty(n))
        state = observe(state, M, bias, measured[i], sensed, made.gain, dt)
        if i % every == every - 1:
            rows.append((t[i, 0], q[i], measured[i], state.residual))
    return ArmSamples(*(np.array(column) for column in zip(*rows, strict=True)))


@cache
def usual_motion() -> ArmSamples:
    """Return 60 s of the usual errors at 1 kHz, which take seconds, once for all tests."""
    return free_motion(Made(), every=1)


def row(found: IdentifiedArm, field: str) -> Quantity:
    """What was identified of a field of the joints."""
    return next(each for each in found.of_joints() if each.field == field)


def sigmas_off(found: IdentifiedArm, column: int, truth: np.ndarray) -> float:
    """By how many of its standard errors that joint is off which is worst in a column of the joints' numbers."""
    own, errors = (found.fit.of_joints(part)[:, column] for part in (found.fit.numbers, found.fit.errors))
    return float((np.abs(own - truth) / errors).max())
