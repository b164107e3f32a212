"""Physics steps in one compiled call: drives, MuJoCo, torque sensors, and what the arm's own computer makes of them.

Called one by one from Python, these cost more than twice what they compute.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry
from pretouch.contact.observer import _observe
from pretouch.sim.drive import Cogging, Friction, Impedance, Joints, MotionGenerator, TorqueSensors, drive, sensed
from pretouch.sim.mujoco_calls import mj_comPos, mj_comVel, mj_crb, mj_fullM, mj_kinematics, mj_rne, mj_step
from pretouch.types import FloatArray

_follow = _observe.flat


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
        # the state after the step goes with the torques that led to it
        computer.q[:] = joints.q
        computer.qd[:] = joints.qd + velocity_noise[step]
        measured = sensed(tau, lost, torque_noise[step], computer.q, world.qdd, arm.sensors)
        _dynamics(arm.nominal, computer.q, computer.qd, mass_matrix, computer.bias)
        computer.residual[:], computer.integral[:] = _follow(
            computer.integral, computer.mass_matrix, mass_matrix, computer.bias, computer.qd, measured, computer.gain,
            computer.dt,
        )  # fmt: skip
        computer.mass_matrix[:] = mass_matrix
        if len(past):
            past[step, 0], past[step, 1], past[step, 2] = computer.q, computer.qd, arm.generator.q_d
            past[step, 3], past[step, 4] = qd_set, computer.residual
        if world.contacts[0] > 0.0:
            return step + 1
    return len(velocity_noise)


@compiled
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
