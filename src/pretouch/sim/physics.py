"""Physics steps in one compiled call: drives, MuJoCo, torque sensors, and what the arm's own computer makes of them.

Called one by one from Python, these cost more than twice what they compute.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry, kernel
from pretouch.sim.drive import Cogging, Friction, Impedance, Joints, MotionGenerator, TorqueSensors, drive, sensed
from pretouch.sim.mujoco_calls import mj_comPos, mj_comVel, mj_crb, mj_fullM, mj_kinematics, mj_rne, mj_step
from pretouch.sim.observer import ObserverState, observe
from pretouch.types import FloatArray


class World(NamedTuple):
    """The simulation, in MuJoCo's memory."""

    model: int  # address of its model
    data: int  # address of its data
    qdd: FloatArray  # (n,) joint accelerations in the last step [rad/s^2]
    contacts: FloatArray  # (1,) how many contacts it had


class Nominal(NamedTuple):
    """The model that the arm's own computer has of it, in MuJoCo's memory."""

    model: int  # address of the model
    data: int  # address of its data
    qpos: FloatArray  # (n,) [rad]
    qvel: FloatArray  # (n,) [rad/s]


class Computer(NamedTuple):
    """What the arm's own computer keeps from one step to the next; all (n,) but for the mass matrix."""

    q: FloatArray  # measured positions [rad]
    qd: FloatArray  # measured velocities [rad/s]
    bias: FloatArray  # Coriolis and gravity torques of the nominal model [Nm]
    residual: FloatArray  # of the observer: estimated external torques [Nm]
    integral: FloatArray  # of the observer [Nm s]
    mass_matrix: FloatArray  # (n, n) of the nominal model [kg m^2]
    gain: float  # of the observer [1/s]
    dt: float  # [s]


class SimulatedArm(NamedTuple):
    """All that a step takes and changes."""

    world: World
    joints: Joints
    generator: MotionGenerator
    impedance: Impedance
    friction: Friction
    cogging: Cogging
    sensors: TorqueSensors
    nominal: Nominal
    computer: Computer
    qd_before: FloatArray  # (n,) joint velocities before the last step [rad/s]


@entry
def take_steps(
    qd_set: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray, past: FloatArray, arm: SimulatedArm
) -> int:
    """Take S physics steps, or fewer: up to the first after which something touches. Return how many.

    `qd_set` (n,) are the velocity set-points [rad/s]. The noise is (S, n), [rad/s] and [Nm]. Into `past` (S, 5, n)
    comes what the arm's interface knows after each step: q, qd, q_d, qd_d and external torques; (0, 5, n): nowhere.
    """
    world, joints, computer = arm.world, arm.joints, arm.computer
    mass_matrix = np.empty_like(computer.mass_matrix)
    for step in range(len(velocity_noise)):
        tau, lost = drive(
            qd_set, computer.bias, joints, arm.generator, arm.impedance, arm.friction, arm.cogging
        )  # fmt: skip
        arm.qd_before[:] = joints.qd
        mj_step(world.model, world.data)
        _conclude(arm, tau, lost, velocity_noise[step], torque_noise[step], mass_matrix)
        if len(past):
            _report(arm, qd_set, past[step])
        if world.contacts[0] > 0.0:
            return step + 1
    return len(velocity_noise)


@compiled
def begin_step(qd_set: FloatArray, arm: SimulatedArm) -> tuple[FloatArray, FloatArray]:
    """Drive an arm in a step that another takes; return what `end_step` is to be given of it."""
    arm.qd_before[:] = arm.joints.qd
    return drive(qd_set, arm.computer.bias, arm.joints, arm.generator, arm.impedance, arm.friction, arm.cogging)


@compiled
def end_step(
    qd_set: FloatArray, tau: FloatArray, lost: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray,
    past: FloatArray, arm: SimulatedArm,
) -> None:  # fmt: skip
    """Have the arm's own computer measure after the step, as `take_steps` does of one step; `past` is (5, n)."""
    _conclude(arm, tau, lost, velocity_noise, torque_noise, np.empty_like(arm.computer.mass_matrix))
    _report(arm, qd_set, past)


@kernel
def _conclude(
    arm: SimulatedArm, tau: FloatArray, lost: FloatArray, velocity_noise: FloatArray, torque_noise: FloatArray,
    mass_matrix: FloatArray,
) -> None:  # fmt: skip
    """Measure after a step that was driven by `tau` (n,), of which friction took `lost` (n,) [Nm]."""
    computer = arm.computer
    # the state after the step goes with the torques that led to it
    computer.q[:] = arm.joints.q
    computer.qd[:] = arm.joints.qd + velocity_noise
    measured = sensed(tau, lost, torque_noise, computer.q, arm.world.qdd, arm.sensors)
    _dynamics(arm.nominal, computer.q, computer.qd, mass_matrix, computer.bias)
    before = ObserverState(computer.residual, computer.integral, computer.mass_matrix)
    after = observe(before, mass_matrix, computer.bias, computer.qd, measured, computer.gain, computer.dt)
    computer.residual[:], computer.integral[:] = after.residual, after.integral
    computer.mass_matrix[:] = mass_matrix


@kernel
def _report(arm: SimulatedArm, qd_set: FloatArray, past: FloatArray) -> None:
    """Write (5, n) what the arm's interface knows after a step."""
    computer = arm.computer
    past[0], past[1], past[2], past[3], past[4] = computer.q, computer.qd, arm.generator.q_d, qd_set, computer.residual


@kernel
def _dynamics(nominal: Nominal, q: FloatArray, qd: FloatArray, mass_matrix: FloatArray, bias: FloatArray) -> None:
    """Do what `RobotModel.mass_matrix_and_bias` does."""
    nominal.qpos[:], nominal.qvel[:] = q, qd
    model, data = nominal.model, nominal.data
    mj_kinematics(model, data)
    mj_comPos(model, data)
    mj_crb(model, data)
    mj_comVel(model, data)
    mj_rne(model, data, 0, bias.ctypes.data)
    mj_fullM(model, data, mass_matrix.ctypes.data)
