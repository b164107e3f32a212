"""A program that drives the arm by `Ros2Robot`, to be killed: joint velocities that swing, until it is told to end."""

import sys

import numpy as np

from pretouch.control.joint_box import joint_box, joint_limits
from pretouch.loop import MonotonicClock
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams, NodeParams
from pretouch_ros2.robot import Ros2Robot

PERIOD = 0.01


def main(domain: int) -> None:
    model = RobotModel(panda())
    limits = joint_limits(model, 0.01, PERIOD)
    with Ros2Node(NodeParams(domain=domain)) as node, Ros2Robot(ArmParams("by-robot", "base"), model, node) as robot:
        robot.wait(10)
        robot.begin()
        clock, sent, start = MonotonicClock(PERIOD), np.zeros(7), None
        while True:
            now = clock.tick()
            start = start or now
            state = robot.read()
            speed = 0.8 * min(now - start, 1.0)
            wanted = speed * np.sin(2.0 * (now - start) + np.arange(7))
            lower, upper = joint_box(state.q_commanded, state.qd_commanded, limits)
            sent = np.clip(wanted, lower, upper)
            robot.command(sent)
            print(*sent, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))
