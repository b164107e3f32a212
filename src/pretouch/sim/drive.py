"""The joints' drives at 1 kHz: motion generator, impedance, friction, and the torque sensors on the links' side."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import kernel
from pretouch.types import FloatArray


class Joints(NamedTuple):
    """The joints (n,) in MuJoCo's memory, before a step."""

    q: FloatArray  # positions [rad]
    qd: FloatArray  # velocities [rad/s]
    applied: FloatArray  # torques that act in the next step [Nm]


class MotionGenerator(NamedTuple):
    """What turns the velocity set-points into a motion (n,)."""

    q_d: FloatArray  # desired positions [rad]
    qd_d: FloatArray  # desired velocities [rad/s]
    dt: float  # period [s]
    follow: float  # share of the way to a new set-point that the desired velocity goes in one period


class Impedance(NamedTuple):
    """The joint controller (n,)."""

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


class Cogging(NamedTuple):
    """How the gears (n,) shake the arm."""

    torque: FloatArray  # amplitude [Nm]
    cycles: FloatArray  # cycles of it in a turn
    phase: FloatArray  # [rad]


class TorqueSensors(NamedTuple):
    """How the joint torque sensors (n,) err."""

    offset: FloatArray  # [Nm]
    ripple: FloatArray  # amplitude of the gear ripple [Nm]
    cycles: FloatArray  # cycles of it in a turn
    phase: FloatArray  # [rad]
    noise: FloatArray  # coloured noise of the last step [Nm]
    keep: float  # share of it that the next step keeps
    armature: float  # rotor inertia, on the motor's side of the sensors [kg m^2]
    compensated: float  # share of the friction that is known and taken off
    spring: FloatArray  # (2, n) torques of the joints' springs [Nm], and how fast they grow, times the time step [Nm]
    turn: float  # how far these turn in a step [rad]; 0: rigid joints
    damping: float  # as a fraction of critical


@kernel
def drive(
    qd_set: FloatArray, bias: FloatArray, joints: Joints, generator: MotionGenerator, impedance: Impedance,
    friction: Friction, cogging: Cogging,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Advance the motion generator, apply the gears' torques less friction, and return both (n,) [Nm].

    `qd_set` (n,) are the velocity set-points [rad/s], `bias` (n,) Coriolis and gravity torques of the nominal model.
    """
    n, q_d, qd_d = len(joints.q), generator.q_d, generator.qd_d
    tau, lost = np.empty(n), np.empty(n)
    for i in range(n):
        # positions integrate the set-points as they are: through the low-pass they would lag behind for good
        q_d[i] += qd_set[i] * generator.dt
        qd_d[i] += generator.follow * (qd_set[i] - qd_d[i])
        # tau = K (q_d - q) + D (qd_d - qd) + tau_ff + C qd + g
        spring = impedance.stiffness[i] * (q_d[i] - joints.q[i])
        damper = impedance.damping[i] * (qd_d[i] - joints.qd[i])
        wanted = spring + damper + impedance.feed_forward[i] + bias[i]
        tau[i] = min(max(wanted, -impedance.tau_max[i]), impedance.tau_max[i])
        # Gaz et al. 2019; the second term makes it vanish at rest
        f1, f2, f3 = friction.f1[i], friction.f2[i], friction.f3[i]
        lost[i] = f1 / (1 + np.exp(-f2 * (joints.qd[i] + f3))) - f1 / (1 + np.exp(-f2 * f3))
        if friction.bristle_nm > 0.0:
            lost[i] += _bent(joints.qd[i], i, friction, generator.dt)
        lost[i] *= 1.0 + friction.cold[0]
        lost[i] += friction.load * abs(tau[i]) * np.tanh(joints.qd[i] / friction.stribeck_rad_s)
        tau[i] += cogging.torque[i] * np.sin(cogging.cycles[i] * joints.q[i] + cogging.phase[i])
        joints.applied[i] = tau[i] - lost[i]
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
