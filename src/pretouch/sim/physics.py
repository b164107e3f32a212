"""Physics steps in one compiled call: drives, MuJoCo, torque sensors, and what the arm's own computer makes of them.

Called one by one from Python, these cost more than twice what they compute.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from pretouch.compiled import compiled, entry, kernel
from pretouch.robot.model import RobotModel
from pretouch.sim.mujoco_calls import mj_comPos, mj_comVel, mj_crb, mj_fullM, mj_kinematics, mj_rne, mj_step
from pretouch.sim.observer import ObserverState, observe
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.rays import Ranging, measure
from pretouch.sim.scene import CONTACTS
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


class HandMemory(NamedTuple):
    """A person's hand, in MuJoCo's memory, and what the person does with it; empty arrays where there is none."""

    position: FloatArray  # (3,) away from its home [m]
    velocity: FloatArray  # (3,) [m/s]
    force: FloatArray  # (3,) on it in the next step [N]
    link_position: FloatArray  # (L, 3) origins [m] of the arm's links
    link_rotation: FloatArray  # (L, 9) rows of their rotation matrices
    places: FloatArray  # (5, 3) rows below
    numbers: FloatArray  # (7,) entries below


AT_HOME, END, AIM, POINT, RATE = range(5)
"""Rows of `HandMemory.places`: where the hand is at home, and where the far end of the spring is [m]; where the person
wants the hand, seen from a point of a link [m]; that point at an instant, and how it moves on, frame of the link [m],
[m/s]."""
LINK, SINCE, FORCE, ROUND, SPEED, STIFFNESS, DAMPING = range(7)
"""Entries of `HandMemory.numbers`: the link, the instant [s], the largest force [N], whether the hand goes round the
arm; of the person's arm `hand.PersonArm`."""


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


def memory_of(
    built: mujoco.MjModel, data: mujoco.MjData, own: slice, model: RobotModel, p: PlantParams, phase: FloatArray
) -> ArmMemory:
    """Put together what physics steps take of an arm whose joints are `own` among MuJoCo's; stiffness and offset are 0.

    `phase` (n,) is that of its joints' ripple [rad].
    """
    zero, q = np.zeros(model.n), data.qpos[own].copy()
    mass, bias = model.mass_matrix_and_bias(q, zero, zero.copy())
    # at rest the impedance settles where it holds what the model does not know; start there, not with a jerk
    q_d = q + (data.qfrc_bias[own] - bias) / np.array(p.stiffness_nm_rad)
    counted = int(built.sensor(CONTACTS).adr[0])
    nominal, scratch = model.scratch
    state = np.zeros((8, model.n))
    state[SPRING] = state[BIAS] = bias
    motion = data.qpos[own], data.qvel[own], data.qacc[own], data.qfrc_applied[own]
    friction, ripple = (p.friction_f1_nm, p.friction_f2_s_rad, p.friction_f3_rad_s), (p.ripple_nm, p.ripple_cycles)
    return ArmMemory(
        p=p.numbers,
        world=Simulation(built._address, data._address, *motion, data.sensordata[counted : counted + 1]),
        nominal=NominalModel(nominal._address, scratch._address, scratch.qpos, scratch.qvel),
        follow=1.0 - float(np.exp(-2 * np.pi * p.set_point_hz * p.period_s)),
        keep=float(np.exp(-2 * np.pi * p.torque_noise_hz * p.period_s)),
        turn=2 * np.pi * p.ring_hz * p.period_s,
        figures=np.array([model.description.tau_max, *friction, *ripple, phase]),
        impedance=np.zeros((3, model.n)),
        offset=zero.copy(),
        cold=np.array([p.cold_friction]),
        report=np.array([q, zero, q_d, zero, zero]),
        state=state,
        mass_matrix=mass,
    )


Q, QD, Q_D, QD_SET, EXTERNAL = range(5)
"""Rows of `ArmMemory.report`."""
QD_D, BRISTLE, NOISE, SPRING, GROWTH, BIAS, INTEGRAL, QD_BEFORE = range(8)
"""Rows of `ArmMemory.state`: velocities that the motion generator asks for [rad/s]; how far the bristles are bent
[rad]; coloured noise [Nm]; torques of the joints' springs [Nm], and how fast they grow, times the time step [Nm];
Coriolis and gravity torques of the nominal model [Nm]; the observer's integral [Nm s]; joint velocities before the last
step [rad/s]."""


@entry
def take_steps(
    first: int,
    times: FloatArray,
    noise: FloatArray,
    past: FloatArray,
    arm: ArmMemory,
    hand: HandMemory,
    ranging: Ranging | None,
    rng: np.random.Generator | None,
) -> int:
    """Take physics steps from a number on, to the last, or to the first after which something touches.

    Or while there is room for what range finders measure. Returns the number of the next. They begin at `times` (S,)
    [s]. The noise (S', 2, n) is of velocities [rad/s] and torques [Nm]. Into `past` (S', 5, n) comes the arm's report
    after each step; (0, 5, n): nowhere.
    """
    for step in range(first, len(times)):
        if ranging is not None and rng is not None:
            if ranging.rows[0] + len(ranging.silent) > len(ranging.sent):
                return step
            measure(times[step], ranging, rng)
        if len(hand.force):
            pull(hand, times[step], arm.p.period_s)
        tau, lost = begin_step(arm)
        mj_step(arm.world.model, arm.world.data)
        end_step(arm, tau, lost, noise[step, 0], noise[step, 1])
        if len(past):
            past[step] = arm.report
        if arm.world.contacts[0] > 0.0:
            return step + 1
    return len(times)


@kernel
def pull(hand: HandMemory, time: float, dt: float) -> None:
    """Move the far end of the spring that the hand hangs on, and lay the spring's force on the hand."""
    n, last, link = hand.numbers, hand.places[END], int(hand.numbers[LINK])
    x, goal = hand.places[AT_HOME] + hand.position, hand.places[AIM] + hand.link_position[link]
    for i in range(3):
        for j in range(3):
            point = hand.places[POINT, j] + hand.places[RATE, j] * (time - n[SINCE])
            goal[i] += hand.link_rotation[link, 3 * i + j] * point
    if n[ROUND] > 0.0:
        goal = way_round(x, goal)
    at = last + _shortened(goal - last, n[SPEED] * dt)
    # never farther ahead than the largest force stretches the spring: a person who lets go pulls back at once
    at = x + _shortened(at - x, n[FORCE] / n[STIFFNESS])
    pulling = n[STIFFNESS] * (at - x) + n[DAMPING] * ((at - last) / dt - hand.velocity)
    hand.force[:], hand.places[END] = _shortened(pulling, n[FORCE]), at


@kernel
def _shortened(vector: FloatArray, length: float) -> FloatArray:
    size = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    return vector if size <= length else vector * (length / size)


_AISLE_X_M = 1.15
"""Plane in front of the Panda's reach in which a hand changes sides, so that it meets the arm only on purpose [m]."""


@compiled
def way_round(hand: FloatArray, goal: FloatArray) -> FloatArray:
    """Next point (3,) [m] on a way from hand to goal (3,) [m] that does not cross the arm."""
    aside = abs(hand[1] - goal[1])
    if hand[0] < _AISLE_X_M - 0.1:
        return goal if aside < 0.35 else np.array([_AISLE_X_M, hand[1], hand[2]])
    return np.array([_AISLE_X_M, goal[1], goal[2]]) if aside > 0.1 else goal


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
