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
    """All that a step takes and changes, of an arm with n joints. Few arrays: each costs a call from Python time."""

    p: PlantParams
    world: Simulation
    nominal: NominalModel
    follow: float  # share of the way to a new set-point that the motion generator's velocities go in one period
    keep: float  # share of the last step's coloured noise that the next one keeps
    turn: float  # how far the joints' springs turn in a step [rad]; 0: rigid joints
    figures: FloatArray  # (7, n) torque limit [Nm]; F1 [Nm], F2 [s/rad], F3 [rad/s]; ripple [Nm], cycles, phase [rad]
    impedance: FloatArray  # (3, n) stiffness [Nm/rad], damping [Nm s/rad], and torques beside theirs [Nm]
    offset: FloatArray  # (n,) errors of the torque sensors [Nm]
    cold: FloatArray  # (1,) by what part of itself friction is larger now
    report: FloatArray  # (5, n) what the interface knows: q, qd, q_d, qd_set, external torques
    state: FloatArray  # (8, n), rows below
    mass_matrix: FloatArray  # (n, n) of the nominal model [kg m^2]


Q, QD, Q_D, QD_SET, EXTERNAL = range(5)
"""Rows of `ArmMemory.report`."""
QD_D, BRISTLE, NOISE, SPRING, GROWTH, BIAS, INTEGRAL, QD_BEFORE = range(8)
"""Rows of `ArmMemory.state`: velocities that the motion generator asks for [rad/s]; how far the bristles are bent
[rad]; coloured noise [Nm]; torques of the joints' springs [Nm], and how fast they grow, times the time step [Nm];
Coriolis and gravity torques of the nominal model [Nm]; the observer's integral [Nm s]; joint velocities before the last
step [rad/s]."""


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
    p, world, q_d, qd_set, qd_d = arm.p, arm.world, arm.report[Q_D], arm.report[QD_SET], arm.state[QD_D]
    n = len(q_d)
    tau, lost = np.empty(n), np.empty(n)
    arm.state[QD_BEFORE] = world.qd
    for i in range(n):
        f1, f2, f3, ripple = arm.figures[1, i], arm.figures[2, i], arm.figures[3, i], arm.figures[4, i]
        # positions integrate the set-points as they are: through the low-pass they would lag behind for good
        q_d[i] += qd_set[i] * p.period_s
        qd_d[i] += arm.follow * (qd_set[i] - qd_d[i])
        # tau = K (q_d - q) + D (qd_d - qd) + tau_ff + C qd + g
        spring = arm.impedance[0, i] * (q_d[i] - world.q[i])
        damper = arm.impedance[1, i] * (qd_d[i] - world.qd[i])
        driving = spring + damper + arm.impedance[2, i] + arm.state[BIAS, i]
        tau[i] = min(max(driving, -arm.figures[0, i]), arm.figures[0, i])
        # Gaz et al. 2019; the second term makes it vanish at rest
        lost[i] = f1 / (1 + np.exp(-f2 * (world.qd[i] + f3))) - f1 / (1 + np.exp(-f2 * f3))
        if p.bristle_nm > 0.0:
            lost[i] += _bent(arm, i)
        lost[i] *= 1.0 + arm.cold[0]
        lost[i] += p.load_friction * abs(tau[i]) * np.tanh(world.qd[i] / p.stribeck_rad_s)
        tau[i] += p.cogging * ripple * np.sin(arm.figures[5, i] * world.q[i] + arm.figures[6, i])
        world.applied[i] = tau[i] - lost[i]
    return tau, lost


@kernel
def _bent(arm: ArmMemory, i: int) -> float:
    """Bend a joint's bristles on, and return the torque they take [Nm].

    LuGre's friction (Canudas de Wit et al. 1995): z' = qd - |qd| z / z_s(qd), z_s = z_c (1 + s exp(-(qd / v_s)^2)), and
    the torque is F_c z / z_c.
    """
    p, z, qd = arm.p, arm.state[BRISTLE, i], arm.world.qd[i]
    most = p.bristle_rad * (1.0 + p.stribeck * np.exp(-((qd / p.stribeck_rad_s) ** 2)))
    # implicit in z, and so stable at any speed
    arm.state[BRISTLE, i] = (z + p.period_s * qd) / (1.0 + p.period_s * abs(qd) / most)
    return float(p.bristle_nm * arm.state[BRISTLE, i] / p.bristle_rad)


@compiled
def end_step(
    arm: ArmMemory, tau: FloatArray, lost: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray
) -> None:
    """Have the arm's own computer measure after a step: `tau` and `lost` (n,) [Nm] are what `begin_step` returned."""
    report, nominal, bias, integral = arm.report, arm.nominal, arm.state[BIAS], arm.state[INTEGRAL]
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
    mj_rne(nominal.model, nominal.data, 0, bias.ctypes.data)
    mj_fullM(nominal.model, nominal.data, mass_matrix.ctypes.data)
    before = ObserverState(report[EXTERNAL], integral, arm.mass_matrix)
    gain, dt = arm.p.observer_gain_1_s, arm.p.period_s
    after = observe(before, mass_matrix, bias, report[QD], measured, gain, dt)
    report[EXTERNAL], integral[:], arm.mass_matrix[:] = after.residual, after.integral, mass_matrix


@kernel
def _sensed(arm: ArmMemory, tau: FloatArray, lost: FloatArray, drawn: FloatArray) -> FloatArray:
    """Joint torques (n,) [Nm] as the link-side sensors report them, known friction already taken off.

    `drawn` (n,) [Nm] is what is new in the noise.
    """
    p, noise, spring, growth = arm.p, arm.state[NOISE], arm.state[SPRING], arm.state[GROWTH]
    sensed = np.empty(len(tau))
    for i in range(len(tau)):
        noise[i] = arm.keep * noise[i] + drawn[i]
        rippled = arm.figures[4, i] * np.sin(arm.figures[5, i] * arm.world.q[i] + arm.figures[6, i])
        # the torque that accelerates the rotor never reaches a sensor on the link's side
        passed = tau[i] - p.armature_kg_m2 * arm.world.qdd[i]
        if arm.turn > 0.0:
            # a link on a spring: y'' = w^2 (passed - y) - 2 d w y'
            growth[i] += arm.turn * (arm.turn * (passed - spring[i]) - 2.0 * p.ring_damping * growth[i])
            spring[i] += growth[i]
            passed = spring[i]
        sensed[i] = passed + arm.offset[i] + rippled + noise[i] - p.friction_compensated * lost[i]
    return sensed
