"""Physics steps in one compiled call: drives, MuJoCo, torque sensors, and what the arm's own computer makes of them.

Called one by one from Python, these cost more than twice what they compute.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, kernel
from pretouch.sim.mujoco_calls import mj_comPos, mj_comVel, mj_crb, mj_fullM, mj_kinematics, mj_rne, mj_step
from pretouch.sim.observer import ObserverState, observe
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


class Drives(NamedTuple):
    """What turns the velocity set-points into a motion, and the joint controller that follows it (n,)."""

    q_d: FloatArray  # desired positions [rad]
    qd_d: FloatArray  # desired velocities [rad/s]
    dt: float  # period [s]
    follow: float  # share of the way to a new set-point that the desired velocity goes in one period
    stiffness: FloatArray  # [Nm/rad]
    damping: FloatArray  # [Nm s/rad]
    feed_forward: FloatArray  # torques beside those of spring and damper [Nm]
    tau_max: FloatArray  # torque limits [Nm]


class Friction(NamedTuple):
    """Of the joints (n,); see `PlantParams`."""

    f1: FloatArray  # [Nm]
    f2: FloatArray  # [s/rad]
    f3: FloatArray  # [rad/s]
    bristle: FloatArray  # how far the bristles are bent [rad]
    bristle_nm: float
    bristle_rad: float
    stribeck: float
    stribeck_rad_s: float
    load: float  # by what part of the torque friction grows
    cold: FloatArray  # (1,) by what part of itself it is larger now


class TorqueSensors(NamedTuple):
    """How the joint torque sensors (n,) err, and the gears shake the arm."""

    offset: FloatArray  # [Nm]
    ripple: FloatArray  # amplitude of the gear ripple [Nm]
    cycles: FloatArray  # cycles of it in a turn
    phase: FloatArray  # [rad]
    cogging: float  # amplitude with which the gears themselves shake the arm, times the ripple
    noise: FloatArray  # coloured noise of the last step [Nm]
    keep: float  # share of it that the next step keeps
    armature: float  # rotor inertia, on the motor's side of the sensors [kg m^2]
    compensated: float  # share of the friction that is known and taken off
    spring: FloatArray  # (2, n) torques of the joints' springs [Nm], and how fast they grow, times the time step [Nm]
    turn: float  # how far these turn in a step [rad]; 0: rigid joints
    damping: float  # as a fraction of critical


class Computer(NamedTuple):
    """What the arm's own computer keeps from one step to the next, (n,); its model of the arm, in MuJoCo's memory."""

    model: int  # address of the model
    data: int  # address of its data
    qpos: FloatArray  # [rad]
    qvel: FloatArray  # [rad/s]
    q: FloatArray  # measured positions [rad]
    qd: FloatArray  # measured velocities [rad/s]
    bias: FloatArray  # Coriolis and gravity torques of the model [Nm]
    residual: FloatArray  # of the observer: estimated external torques [Nm]
    integral: FloatArray  # of the observer [Nm s]
    mass_matrix: FloatArray  # (n, n) of the model [kg m^2]
    gain: float  # of the observer [1/s]
    dt: float  # [s]


class ArmMemory(NamedTuple):
    """All that a step takes and changes."""

    world: Simulation
    drives: Drives
    friction: Friction
    sensors: TorqueSensors
    computer: Computer
    qd_before: FloatArray  # (n,) joint velocities before the last step [rad/s]


@entry
def take_steps(
    qd_set: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray, past: FloatArray, arm: ArmMemory
) -> int:
    """Take S physics steps, or fewer: up to the first after which something touches. Return how many.

    `qd_set` (n,) are the velocity set-points [rad/s]. The noise is (S, n), [rad/s] and [Nm]. Into `past` (S, 5, n)
    comes what the arm's interface knows after each step: q, qd, q_d, qd_d and external torques; (0, 5, n): nowhere.
    """
    world, mass_matrix = arm.world, np.empty_like(arm.computer.mass_matrix)
    for step in range(len(velocity_noise)):
        tau, lost = begin_step(qd_set, arm)
        mj_step(world.model, world.data)
        _conclude(arm, tau, lost, velocity_noise[step], torque_noise[step], mass_matrix)
        if len(past):
            _report(arm, qd_set, past[step])
        if world.contacts[0] > 0.0:
            return step + 1
    return len(velocity_noise)


@compiled
def begin_step(qd_set: FloatArray, arm: ArmMemory) -> tuple[FloatArray, FloatArray]:
    """Drive an arm in a step that begins; return what `end_step` takes of it."""
    arm.qd_before[:] = arm.world.qd
    return drive(qd_set, arm.computer.bias, arm.world, arm.drives, arm.friction, arm.sensors)


@compiled
def end_step(
    qd_set: FloatArray, tau: FloatArray, lost: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray,
    past: FloatArray, arm: ArmMemory,
) -> None:  # fmt: skip
    """Have the arm's own computer measure after the step, as `take_steps` does of one step; `past` is (5, n)."""
    _conclude(arm, tau, lost, velocity_noise, torque_noise, np.empty_like(arm.computer.mass_matrix))
    _report(arm, qd_set, past)


@kernel
def drive(
    qd_set: FloatArray, bias: FloatArray, world: Simulation, drives: Drives, friction: Friction, sensors: TorqueSensors
) -> tuple[FloatArray, FloatArray]:
    """Advance the motion generator, apply the gears' torques less friction, and return both (n,) [Nm].

    `qd_set` (n,) are the velocity set-points [rad/s], `bias` (n,) Coriolis and gravity torques of the nominal model.
    """
    n, q_d, qd_d = len(world.q), drives.q_d, drives.qd_d
    tau, lost = np.empty(n), np.empty(n)
    for i in range(n):
        # positions integrate the set-points as they are: through the low-pass they would lag behind for good
        q_d[i] += qd_set[i] * drives.dt
        qd_d[i] += drives.follow * (qd_set[i] - qd_d[i])
        # tau = K (q_d - q) + D (qd_d - qd) + tau_ff + C qd + g
        spring = drives.stiffness[i] * (q_d[i] - world.q[i])
        damper = drives.damping[i] * (qd_d[i] - world.qd[i])
        driving = spring + damper + drives.feed_forward[i] + bias[i]
        tau[i] = min(max(driving, -drives.tau_max[i]), drives.tau_max[i])
        # Gaz et al. 2019; the second term makes it vanish at rest
        f1, f2, f3 = friction.f1[i], friction.f2[i], friction.f3[i]
        lost[i] = f1 / (1 + np.exp(-f2 * (world.qd[i] + f3))) - f1 / (1 + np.exp(-f2 * f3))
        if friction.bristle_nm > 0.0:
            lost[i] += _bent(world.qd[i], i, friction, drives.dt)
        lost[i] *= 1.0 + friction.cold[0]
        lost[i] += friction.load * abs(tau[i]) * np.tanh(world.qd[i] / friction.stribeck_rad_s)
        cogging = sensors.cogging * sensors.ripple[i]
        tau[i] += cogging * np.sin(sensors.cycles[i] * world.q[i] + sensors.phase[i])
        world.applied[i] = tau[i] - lost[i]
    return tau, lost


@kernel
def _bent(qd: float, i: int, friction: Friction, dt: float) -> float:
    """Bend a joint's bristles on, and return the torque they take [Nm].

    LuGre's friction (Canudas de Wit et al. 1995): z' = qd - |qd| z / z_s(qd), z_s = z_c (1 + s exp(-(qd / v_s)^2)), and
    the torque is F_c z / z_c.
    """
    z_c, z = friction.bristle_rad, friction.bristle[i]
    most = z_c * (1.0 + friction.stribeck * np.exp(-((qd / friction.stribeck_rad_s) ** 2)))
    # implicit in z, and so stable at any speed
    friction.bristle[i] = (z + dt * qd) / (1.0 + dt * abs(qd) / most)
    return float(friction.bristle_nm * friction.bristle[i] / z_c)


@kernel
def sensed(
    tau: FloatArray, lost: FloatArray, drawn: FloatArray, q: FloatArray, qdd: FloatArray, sensors: TorqueSensors
) -> FloatArray:
    """Joint torques (n,) [Nm] as the link-side sensors report them, known friction already taken off.

    Of a step that led to q (n,) [rad] by qdd (n,) [rad/s^2]: `tau` and `lost` as of `drive`; `drawn` (n,) [Nm] is what
    is new in the noise.
    """
    noise, sensed = sensors.noise, np.empty(len(tau))
    for i in range(len(tau)):
        noise[i] = sensors.keep * noise[i] + drawn[i]
        rippled = sensors.ripple[i] * np.sin(sensors.cycles[i] * q[i] + sensors.phase[i])
        # the torque that accelerates the rotor never reaches a sensor on the link's side
        passed = tau[i] - sensors.armature * qdd[i]
        if sensors.turn > 0.0:
            # a link on a spring: y'' = w^2 (passed - y) - 2 d w y'
            grows = sensors.turn * (
                sensors.turn * (passed - sensors.spring[0, i]) - 2.0 * sensors.damping * sensors.spring[1, i]
            )
            sensors.spring[1, i] += grows
            sensors.spring[0, i] += sensors.spring[1, i]
            passed = sensors.spring[0, i]
        sensed[i] = passed + sensors.offset[i] + rippled + noise[i] - sensors.compensated * lost[i]
    return sensed


@kernel
def _conclude(
    arm: ArmMemory, tau: FloatArray, lost: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray,
    mass_matrix: FloatArray,
) -> None:  # fmt: skip
    """Measure after a step that was driven by `tau` (n,), of which friction took `lost` (n,) [Nm]."""
    own = arm.computer
    # the state after the step goes with the torques that led to it
    own.q[:] = arm.world.q
    own.qd[:] = arm.world.qd + velocity_noise
    measured = sensed(tau, lost, torque_noise, own.q, arm.world.qdd, arm.sensors)
    _dynamics(own, mass_matrix)
    before = ObserverState(own.residual, own.integral, own.mass_matrix)
    after = observe(before, mass_matrix, own.bias, own.qd, measured, own.gain, own.dt)
    own.residual[:], own.integral[:] = after.residual, after.integral
    own.mass_matrix[:] = mass_matrix


@kernel
def _report(arm: ArmMemory, qd_set: FloatArray, past: FloatArray) -> None:
    """Write (5, n) what the arm's interface knows after a step."""
    own = arm.computer
    past[0], past[1], past[2], past[3], past[4] = own.q, own.qd, arm.drives.q_d, qd_set, own.residual


@kernel
def _dynamics(own: Computer, mass_matrix: FloatArray) -> None:
    """Do what `RobotModel.mass_matrix_and_bias` does, for what was measured."""
    own.qpos[:], own.qvel[:] = own.q, own.qd
    model, data = own.model, own.data
    mj_kinematics(model, data)
    mj_comPos(model, data)
    mj_crb(model, data)
    mj_comVel(model, data)
    mj_rne(model, data, 0, own.bias.ctypes.data)
    mj_fullM(model, data, mass_matrix.ctypes.data)
