"""Physics steps in one compiled call: drives, MuJoCo, torque sensors, and what the arm's own computer makes of them.

Called one by one from Python, these cost more than twice what they compute.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, kernel
from pretouch.sim.mujoco_calls import mj_comPos, mj_comVel, mj_crb, mj_fullM, mj_kinematics, mj_rne, mj_step
from pretouch.sim.observer import ObserverState, observe
from pretouch.sim.plant_params import PlantParams
from pretouch.types import FloatArray


class Simulation(NamedTuple):
    """The simulation and the arm's joints (n,) in it, in MuJoCo's memory."""

    model: int  # address of its model
    data: int  # address of its data
    q: FloatArray  # positions [rad]
    qd: FloatArray  # velocities [rad/s]
    qdd: FloatArray  # accelerations in the last step [rad/s^2]
    applied: FloatArray  # torques that act in the next step [Nm]
    contacts: FloatArray  # (1,) how many contacts there were in the last step


class NominalModel(NamedTuple):
    """The model that the arm's own computer has of it, in MuJoCo's memory."""

    model: int  # address of the model
    data: int  # address of its data
    qpos: FloatArray  # (n,) [rad]
    qvel: FloatArray  # (n,) [rad/s]


class ArmMemory(NamedTuple):
    """All that a step takes and changes, of an arm with n joints."""

    p: PlantParams
    world: Simulation
    nominal: NominalModel
    report: FloatArray  # (5, n) what the interface knows: q, qd, q_d, qd_set, external torques
    qd_d: FloatArray  # (n,) velocities that the motion generator asks for [rad/s]
    follow: float  # share of the way to a new set-point that they go in one period
    impedance: FloatArray  # (3, n) stiffness [Nm/rad], damping [Nm s/rad], and torques beside theirs [Nm]
    tau_max: FloatArray  # (n,) torque limits [Nm]
    friction: FloatArray  # (3, n) F1 [Nm], F2 [s/rad], F3 [rad/s]
    bristle: FloatArray  # (n,) how far the bristles are bent [rad]
    cold: FloatArray  # (1,) by what part of itself friction is larger now
    offset: FloatArray  # (n,) errors of the torque sensors [Nm]
    ripple: FloatArray  # (3, n) of the gears: amplitude [Nm], cycles in a turn, phase [rad]
    noise: FloatArray  # (n,) coloured noise of the last step [Nm]
    keep: float  # share of it that the next step keeps
    spring: FloatArray  # (2, n) torques of the joints' springs [Nm], and how fast they grow, times the time step [Nm]
    turn: float  # how far these turn in a step [rad]; 0: rigid joints
    bias: FloatArray  # (n,) Coriolis and gravity torques of the nominal model [Nm]
    integral: FloatArray  # (n,) of the observer [Nm s]
    mass_matrix: FloatArray  # (n, n) of the nominal model [kg m^2]
    qd_before: FloatArray  # (n,) joint velocities before the last step [rad/s]


Q, QD, Q_D, QD_SET, EXTERNAL = range(5)
"""Rows of `ArmMemory.report`."""
STIFFNESS, DAMPING, FEED_FORWARD = range(3)
"""Rows of `ArmMemory.impedance`."""


@entry
def take_steps(
    first: int, last: int, velocity_noise: FloatArray, torque_noise: FloatArray, past: FloatArray, arm: ArmMemory
) -> int:
    """Take some of S physics steps: from one to before another, or to the first after which something touches.

    Returns the number of the next. The noise is (S, n), [rad/s] and [Nm]. Into `past` (S, 5, n) comes the arm's report
    after each step; (0, 5, n): nowhere.
    """
    for step in range(first, last):
        tau, lost = begin_step(arm)
        mj_step(arm.world.model, arm.world.data)
        end_step(arm, tau, lost, velocity_noise[step], torque_noise[step])
        if len(past):
            past[step] = arm.report
        if arm.world.contacts[0] > 0.0:
            return step + 1
    return last


@compiled
def begin_step(arm: ArmMemory) -> tuple[FloatArray, FloatArray]:
    """Advance the motion generator, apply the gears' torques less friction, and return both (n,) [Nm]."""
    p, world, q_d, qd_set, qd_d = arm.p, arm.world, arm.report[Q_D], arm.report[QD_SET], arm.qd_d
    n = len(q_d)
    tau, lost = np.empty(n), np.empty(n)
    arm.qd_before[:] = world.qd
    for i in range(n):
        # positions integrate the set-points as they are: through the low-pass they would lag behind for good
        q_d[i] += qd_set[i] * p.period_s
        qd_d[i] += arm.follow * (qd_set[i] - qd_d[i])
        # tau = K (q_d - q) + D (qd_d - qd) + tau_ff + C qd + g
        spring = arm.impedance[STIFFNESS, i] * (q_d[i] - world.q[i])
        damper = arm.impedance[DAMPING, i] * (qd_d[i] - world.qd[i])
        driving = spring + damper + arm.impedance[FEED_FORWARD, i] + arm.bias[i]
        tau[i] = min(max(driving, -arm.tau_max[i]), arm.tau_max[i])
        # Gaz et al. 2019; the second term makes it vanish at rest
        f1, f2, f3 = arm.friction[0, i], arm.friction[1, i], arm.friction[2, i]
        lost[i] = f1 / (1 + np.exp(-f2 * (world.qd[i] + f3))) - f1 / (1 + np.exp(-f2 * f3))
        if p.bristle_nm > 0.0:
            lost[i] += _bent(arm, i)
        lost[i] *= 1.0 + arm.cold[0]
        lost[i] += p.load_friction * abs(tau[i]) * np.tanh(world.qd[i] / p.stribeck_rad_s)
        cogging = p.cogging * arm.ripple[0, i]
        tau[i] += cogging * np.sin(arm.ripple[1, i] * world.q[i] + arm.ripple[2, i])
        world.applied[i] = tau[i] - lost[i]
    return tau, lost


@kernel
def _bent(arm: ArmMemory, i: int) -> float:
    """Bend a joint's bristles on, and return the torque they take [Nm].

    LuGre's friction (Canudas de Wit et al. 1995): z' = qd - |qd| z / z_s(qd), z_s = z_c (1 + s exp(-(qd / v_s)^2)), and
    the torque is F_c z / z_c.
    """
    p, z, qd = arm.p, arm.bristle[i], arm.world.qd[i]
    most = p.bristle_rad * (1.0 + p.stribeck * np.exp(-((qd / p.stribeck_rad_s) ** 2)))
    # implicit in z, and so stable at any speed
    arm.bristle[i] = (z + p.period_s * qd) / (1.0 + p.period_s * abs(qd) / most)
    return float(p.bristle_nm * arm.bristle[i] / p.bristle_rad)


@compiled
def end_step(
    arm: ArmMemory, tau: FloatArray, lost: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray
) -> None:
    """Have the arm's own computer measure after a step: `tau` and `lost` (n,) [Nm] are what `begin_step` returned."""
    report, nominal = arm.report, arm.nominal
    # the state after the step goes with the torques that led to it
    report[Q] = arm.world.q
    report[QD] = arm.world.qd + velocity_noise
    measured = _sensed(arm, tau, lost, torque_noise)
    # what `RobotModel.mass_matrix_and_bias` does, for what was measured
    nominal.qpos[:], nominal.qvel[:] = report[Q], report[QD]
    mass_matrix = np.empty_like(arm.mass_matrix)
    mj_kinematics(nominal.model, nominal.data)
    mj_comPos(nominal.model, nominal.data)
    mj_crb(nominal.model, nominal.data)
    mj_comVel(nominal.model, nominal.data)
    mj_rne(nominal.model, nominal.data, 0, arm.bias.ctypes.data)
    mj_fullM(nominal.model, nominal.data, mass_matrix.ctypes.data)
    before = ObserverState(report[EXTERNAL], arm.integral, arm.mass_matrix)
    gain, dt = arm.p.observer_gain_1_s, arm.p.period_s
    after = observe(before, mass_matrix, arm.bias, report[QD], measured, gain, dt)
    report[EXTERNAL], arm.integral[:], arm.mass_matrix[:] = after.residual, after.integral, mass_matrix


@kernel
def _sensed(arm: ArmMemory, tau: FloatArray, lost: FloatArray, drawn: FloatArray) -> FloatArray:
    """Joint torques (n,) [Nm] as the link-side sensors report them, known friction already taken off.

    `drawn` (n,) [Nm] is what is new in the noise.
    """
    p, noise, spring, sensed = arm.p, arm.noise, arm.spring, np.empty(len(tau))
    for i in range(len(tau)):
        noise[i] = arm.keep * noise[i] + drawn[i]
        rippled = arm.ripple[0, i] * np.sin(arm.ripple[1, i] * arm.world.q[i] + arm.ripple[2, i])
        # the torque that accelerates the rotor never reaches a sensor on the link's side
        passed = tau[i] - p.armature_kg_m2 * arm.world.qdd[i]
        if arm.turn > 0.0:
            # a link on a spring: y'' = w^2 (passed - y) - 2 d w y'
            spring[1, i] += arm.turn * (arm.turn * (passed - spring[0, i]) - 2.0 * p.ring_damping * spring[1, i])
            spring[0, i] += spring[1, i]
            passed = spring[0, i]
        sensed[i] = passed + arm.offset[i] + rippled + noise[i] - p.friction_compensated * lost[i]
    return sensed
