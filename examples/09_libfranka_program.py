"""A protected program of the vendor's library: it swings the FR3's first joint, and yields to a push.

    pretouch serve-fci --robot fr3 --lockstep --once --push 3:0,30,0:0.3     # in another terminal, or a real arm
    python examples/09_libfranka_program.py 127.0.0.1

Without units the arm only detects contacts. Pass readings of real units (`pretouch.units`) with the state.
"""

import math
import sys

import numpy as np
import pylibfranka

import pretouch as pt
from pretouch.arms.franka.limiter import SetPointLimiter
from pretouch.arms.franka.limits import LimiterParams, motion_limits, planned
from pretouch.arms.franka.state import FrankaState, franka_state, robot_state

arm = pt.RobotModel(planned(pt.fr3(), LimiterParams()))
none = pt.RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def command(shield: pt.Shield, state: FrankaState, now: float, swing: float) -> pt.ControlStep:
    """Return a step with a desired velocity of the first joint [rad/s]."""
    desired = pt.desired.joint_velocities(now, (swing, 0, 0, 0, 0, 0, 0))
    return shield(pt.Inputs(now, robot_state(state, now), none, desired=desired))


robot = pylibfranka.Robot(sys.argv[1], pylibfranka.RealtimeConfig.kIgnore)
robot.set_collision_behavior([60.0] * 7, [60.0] * 7, [60.0] * 6, [60.0] * 6)  # the arm's own reflex comes after ours
state, now = franka_state(robot.read_once()), 0.0
shield = pt.shield(arm, pt.Skin([], arm), robot_state(state, now))
for i in range(1000):  # a second at rest: the force window fills, and all code is compiled
    state, now = franka_state(robot.read_once()), now + 0.001
    if i % 10 == 9:
        step = command(shield, state, now, 0.0)

limiter = SetPointLimiter(motion_limits(arm, "fr3"), LimiterParams())  # the arm limits jerk, too, each millisecond
begun, turns, mode, ended = now, 0, step.mode, False
motion = robot.start_joint_velocity_control(pylibfranka.ControllerMode.JointImpedance)
while not ended:
    raw, since = motion.readOnce()
    state, now = franka_state(raw), now + since.to_sec()
    if now - begun >= 0.01 * turns:
        turns += 1
        step = command(shield, state, now, 0.3 * math.sin(now - begun) if now - begun < 6.0 else 0.0)
        if step.mode is not mode:
            mode = step.mode
            print(f"{now - begun:.2f} s: {step.reason}")
    velocities = pylibfranka.JointVelocities(limiter.step(state, step.command.tolist()))
    velocities.motion_finished = ended = now - begun > 6.0 and limiter.at_rest
    motion.writeOnce(velocities)
print(f"at rest after {now - begun:.1f} s")
