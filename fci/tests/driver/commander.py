"""Run as a process: moves an arm in real time until it is ended; prints the number of the process that speaks to it."""

import sys
import time

import numpy as np

from pretouch.arms.franka.arm import FrankaArm
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel


def main(kind: str, address: str) -> None:
    model = RobotModel(robot_named(kind))
    with FrankaArm(address, kind, model) as arm:  # type: ignore[arg-type]
        arm.begin()
        print(arm.pid, flush=True)
        began = time.monotonic()
        while True:
            arm.command(np.array([0.25 * np.sin(time.monotonic() - began + 1.0), 0, 0, 0, 0, 0, 0.4]))
            time.sleep(0.01)


if __name__ == "__main__":
    main(*sys.argv[1:])
