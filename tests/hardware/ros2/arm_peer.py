"""A simulated arm behind ROS 2 topics, in a process of its own: a joint_trajectory_controller as ros2_control has it.

It takes trajectories from where it is commanded to be (`interpolate_from_desired_state`), by cubic splines through
positions and velocities, at 1 kHz, and publishes joint states, a wrench in the vendor's sign, and ranges that show
nothing near. Lines on its input: `push FX FY FZ` [N, on the arm], `freeze` (the same states again and again), `mute`,
`clear`, `stop`. At the end it writes what was commanded at each millisecond to a file.
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

DT = 0.001


class Spline:
    """What a joint_trajectory_controller asks for: cubic Hermite splines through the points of the last trajectory."""

    def __init__(self, names: list[str], q: np.ndarray) -> None:
        self.names, self.q, self.qd = names, q.copy(), np.zeros_like(q)
        self.time, self.points = np.zeros(1), np.stack([[self.q, self.qd]])
        self.last = 0.0

    def replace(self, message: object, now: float) -> None:
        order = [message.joint_names.index(name) for name in self.names]
        start = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
        start = now if start == 0 else now + start - time_ns() / 1e9
        after = [p.time_from_start.sec + p.time_from_start.nanosec / 1e9 for p in message.points]
        assert all(b > a for a, b in zip([0.0, *after], after, strict=False)), after
        assert not np.any(message.points[-1].velocities)
        # from what was commanded last, at the instant of the last command
        self.time = np.array([self.last, *(start + t for t in after)])
        given = [[p.positions[order], p.velocities[order]] for p in message.points]
        self.points = np.concatenate([[[self.q, self.qd]], given])

    def advance(self, now: float) -> None:
        self.last = now
        i = int(np.searchsorted(self.time, now, side="right")) - 1
        if i >= len(self.time) - 1:
            self.q, self.qd = self.points[-1]
            return
        T, s = self.time[i + 1] - self.time[i], now - self.time[i]
        (q0, v0), (q1, v1) = self.points[i], self.points[i + 1]
        c, d = 3 * (q1 - q0) / T**2 - (2 * v0 + v1) / T, -2 * (q1 - q0) / T**3 + (v0 + v1) / T**2
        self.q, self.qd = q0 + v0 * s + c * s**2 + d * s**3, v0 + 2 * c * s + 3 * d * s**2


def main(domain: int, log: str, rate: float, ideal: bool, extra: bool) -> None:
    model = RobotModel(panda())
    skin, q = paper_skin(model), model.description.q_ready
    plant = Plant(model, SceneSpec(), PlantParams(), q, 0)
    force = plant.mj_data.xfrc_applied[model.ee, :3]
    plant.advance(0.2)
    spline, told, orders = Spline(list(model.joints), q), SimpleQueue(), SimpleQueue()
    Thread(target=lambda: [orders.put(line.split()) for line in sys.stdin], daemon=True).start()
    # another order than the model's, and joints that are none of its
    shuffled = [6, 0, 3, 1, 5, 2, 4]
    names = [model.joints[j] for j in shuffled] + (["finger_1", "finger_2"] if extra else [])
    rows, muted, frozen = [], False, None
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
            now = monotonic()
            steps = int((now - begin) / DT) - tick
            if not steps:
                continue
            tick, before = tick + steps, spline.q
            while not told.empty():
                spline.replace(told.get(), now)
            spline.advance(now)
            rows.append([now, *spline.q, *spline.qd])
            if not ideal:
                plant.command((spline.q - before) / (steps * DT))
                plant.advance(steps * DT)
            while not orders.empty():
                match orders.get():
                    case ["push", x, y, z]:
                        force[:] = float(x), float(y), float(z)
                    case ["freeze"]:
                        frozen = time_ns()
                    case ["mute"]:
                        muted = True
                    case ["clear"]:
                        frozen, muted = None, False
                    case ["stop"]:
                        np.save(log, np.array(rows))
                        return
            if muted or tick // each == sent:
                continue
            sent = tick // each
            today = frozen or time_ns()
            stamp = (today // 10**9, today % 10**9)
            robot = plant.read()
            positions, velocities = (spline.q, spline.qd) if ideal else (robot.q, robot.qd)
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
    main(**vars(parser.parse_args()))
