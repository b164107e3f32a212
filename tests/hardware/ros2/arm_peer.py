"""A simulated arm behind ROS 2 topics, in a process of its own: a joint_trajectory_controller as ros2_control has it.

It takes trajectories as `spline.py` has it for a release, at 1 kHz, and publishes joint states, a wrench in the
vendor's sign, and ranges that show nothing near. Lines on its input: `push FX FY FZ` [N, on the arm], `freeze` (the
same states again and again), `mute`, `deaf` (no command arrives), `clear`, `stop`. At the end it writes to a file the
positions that were commanded at each millisecond.
"""

import argparse
import sys
from queue import SimpleQueue
from threading import Thread
from time import monotonic, sleep, time_ns

import numpy as np

from pretouch.hardware.ros2.messages import JOINT_STATE, RANGE, TRAJECTORY, WRENCH
from pretouch.hardware.ros2.node import Ros2Node
from pretouch.hardware.ros2.params import NodeParams
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from tests.hardware.ros2.spline import Release, Spline

DT = 0.001


def main(domain: int, log: str, rate: float, ideal: bool, extra: bool, release: Release) -> None:
    model = RobotModel(panda())
    skin, q = paper_skin(model), model.description.q_ready
    plant = Plant(model, SceneSpec(), PlantParams(), q, 0)
    force = plant.mj_data.xfrc_applied[model.ee, :3]
    plant.advance(0.2)
    spline, told, orders = Spline(release, DT, list(model.joints), q), SimpleQueue(), SimpleQueue()
    Thread(target=lambda: [orders.put(line.split()) for line in sys.stdin], daemon=True).start()
    # another order than the model's, and joints that are none of its
    shuffled = [6, 0, 3, 1, 5, 2, 4]
    names = [model.joints[j] for j in shuffled] + (["finger_1", "finger_2"] if extra else [])
    rows, muted, deaf, frozen = [], False, False, None
    with Ros2Node(NodeParams(domain=domain)) as node:
        make, header = node.messages.make, node.messages.header
        node.subscribe("/joint_trajectory_controller/joint_trajectory", TRAJECTORY,
                       lambda message, received, writer: told.put(message), reliable=True)  # fmt: skip
        states, wrenches = node.publisher("/joint_states", JOINT_STATE), node.publisher("/wrench", WRENCH)
        ranges = [(name, node.publisher(f"/skin/{name}/range", RANGE)) for name in skin.ids]
        print("ready", flush=True)
        begin, tick, sent, each = monotonic(), 0, 0, round(1 / rate / DT)
        while True:
            sleep(max(begin + (tick + 1) * DT - monotonic(), 0.0))
            now, day = monotonic(), time_ns()
            steps = int((now - begin) / DT) - tick
            if not steps:
                continue
            tick, before = tick + steps, spline.commanded[0]
            while not told.empty():
                message = told.get()
                if not deaf:
                    spline.take(message, time_ns() / 1e9 - monotonic())
            commanded = spline.update(now)
            rows.append([now, *commanded])
            if not ideal:
                plant.command((commanded - before) / (steps * DT))
                plant.advance(steps * DT)
            while not orders.empty():
                match orders.get():
                    case ["push", x, y, z]:
                        force[:] = float(x), float(y), float(z)
                    case ["freeze"]:
                        frozen = day
                    case ["mute"]:
                        muted = True
                    case ["deaf"]:
                        deaf = True
                    case ["clear"]:
                        frozen, muted, deaf = None, False, False
                    case ["stop"]:
                        np.save(log, np.array(rows))
                        return
            if muted or tick // each == sent:
                continue
            sent = tick // each
            # the time of the state, though it was long in the making
            stamp = divmod(frozen or day, 10**9)
            robot = plant.read()
            positions, velocities = spline.commanded if ideal else (robot.q, robot.qd)
            more = np.full(2 if extra else 0, 0.02)
            states.publish(make(JOINT_STATE, header(stamp, ""), names, np.append(positions[shuffled], more),
                                np.append(velocities[shuffled], more), np.zeros(0)))  # fmt: skip
            given = np.zeros(6) if robot.wrench is None else -robot.wrench
            pair = node.messages.xyz("Vector3", given[:3]), node.messages.xyz("Vector3", given[3:])
            wrenches.publish(make(WRENCH, header(stamp, "panda_link0"), make("geometry_msgs/msg/Wrench", *pair)))
            if sent % max(round(rate / 50), 1) == 0:
                for name, publisher in ranges:
                    publisher.publish(make(RANGE, header(stamp, name), 1, 0.47, 0.04, 4.0, np.inf, 0.0))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--domain", type=int)
    parser.add_argument("--log")
    parser.add_argument("--rate", type=float, default=250.0)
    parser.add_argument("--ideal", action="store_true")
    parser.add_argument("--extra", action="store_true")
    parser.add_argument("--release", default="4.21")
    main(**vars(parser.parse_args()))
