"""A simulated arm behind ROS 2 topics, in a process of its own: a joint_trajectory_controller as ros2_control has it.

It takes trajectories as `spline.py` has it for release 4.21, at 1 kHz, and publishes joint states, wrench and external
torques in the vendor's sign, and ranges that show nothing near. Lines on its input: `push FX FY FZ` [N, on the arm],
`freeze` (the same states again and again), `mute`, `deaf` (no command arrives), `clear`, `stop`. At the end it writes
to a file the positions that were commanded at each millisecond.
"""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from time import monotonic, sleep, time_ns

import numpy as np
from ros2.tests.spline import Spline

from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch_ros2.messages import JOINT_STATE, RANGE, TRAJECTORY, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import NodeParams

ROOT = Path(__file__).parents[2]
DT = 0.001
EACH = 4
"""So many milliseconds lie between two states."""


class Peer:
    """The arm and its controller behind topics."""

    def __init__(self, node: Ros2Node) -> None:
        self.node = node
        model = RobotModel(panda())
        skin, q = paper_skin(model), model.description.q_ready
        self.plant = Plant(model, SceneSpec(), PlantParams(), q, 0)
        self.force = self.plant.mj_data.xfrc_applied[model.ee, :3]
        self.plant.advance(0.2)
        self.spline, self.told = Spline("4.21", DT, list(model.joints), q), SimpleQueue()
        # another order than the model's, and joints that are none of its
        self.shuffled = [6, 0, 3, 1, 5, 2, 4]
        self.names, self.more = [model.joints[j] for j in self.shuffled] + ["finger_1", "finger_2"], np.full(2, 0.02)
        self.rows, self.sent, self.muted, self.deaf, self.frozen = [], 0, False, False, None
        node.subscribe("/joint_trajectory_controller/joint_trajectory", TRAJECTORY,
                       lambda message, received, writer: self.told.put(message), reliable=True)  # fmt: skip
        self.states, self.wrenches = node.publisher("/joint_states", JOINT_STATE), node.publisher("/wrench", WRENCH)
        self.torques = node.publisher("/external_joint_torques", JOINT_STATE)
        self.ranges = [(name, node.publisher(f"/skin/{name}/range", RANGE)) for name in skin.ids]

    def advance(self, now: float, steps: int) -> None:
        """Follow what was told for so many steps up to an instant [s]."""
        before = self.spline.commanded[0]
        while not self.told.empty():
            message = self.told.get()
            if not self.deaf:
                self.spline.take(message, time_ns() / 1e9 - monotonic())
        commanded = self.spline.update(now)
        self.rows.append([now, *commanded])
        self.plant.command((commanded - before) / (steps * DT))
        self.plant.advance(steps * DT)

    def obey(self, order: list[str], day: int) -> bool:
        """Do what a line of the input says; return whether to go on."""
        match order:
            case ["push", x, y, z]:
                self.force[:] = float(x), float(y), float(z)
            case ["freeze"]:
                self.frozen = day
            case ["mute"]:
                self.muted = True
            case ["deaf"]:
                self.deaf = True
            case ["clear"]:
                self.frozen, self.muted, self.deaf = None, False, False
        return order != ["stop"]

    def publish(self, day: int) -> None:
        """Tell the state of an instant [ns]."""
        make, header, xyz = self.node.messages.make, self.node.messages.header, self.node.messages.xyz
        # the time of the state, though it was long in the making
        stamp = divmod(self.frozen or day, 10**9)
        robot = self.plant.read()
        pair = (np.append(values[self.shuffled], self.more) for values in (robot.q, robot.qd))
        self.states.publish(make(JOINT_STATE, header(stamp, ""), self.names, *pair, np.zeros(0)))
        # as a state broadcaster does: positions and velocities that say nothing
        nothing = np.zeros(len(self.shuffled))
        self.torques.publish(make(JOINT_STATE, header(stamp, ""), self.names[: len(nothing)], nothing, nothing,
                                  -robot.tau_ext[self.shuffled]))  # fmt: skip
        given = np.zeros(6) if robot.wrench is None else -robot.wrench
        pair = xyz("Vector3", given[:3]), xyz("Vector3", given[3:])
        self.wrenches.publish(make(WRENCH, header(stamp, "panda_link0"), make("geometry_msgs/msg/Wrench", *pair)))
        if self.sent % 5 == 0:
            for name, publisher in self.ranges:
                publisher.publish(make(RANGE, header(stamp, name), 1, 0.47, 0.04, 4.0, np.inf, 0.0))


def main(domain: int, log: str) -> None:
    orders = SimpleQueue()
    Thread(target=lambda: [orders.put(line.split()) for line in sys.stdin], daemon=True).start()
    with Ros2Node(NodeParams(domain=domain)) as node:
        peer = Peer(node)
        print("ready", flush=True)
        begin, tick = monotonic(), 0
        while True:
            sleep(max(begin + (tick + 1) * DT - monotonic(), 0.0))
            now, day = monotonic(), time_ns()
            steps = int((now - begin) / DT) - tick
            if not steps:
                continue
            tick += steps
            peer.advance(now, steps)
            while not orders.empty():
                if not peer.obey(orders.get(), day):
                    np.save(log, np.array(peer.rows))
                    return
            if not peer.muted and tick // EACH != peer.sent:
                peer.sent = tick // EACH
                peer.publish(day)


class ArmPeer:
    """The process, as tests have it."""

    def __init__(self, process: subprocess.Popen[str], log: Path) -> None:
        self._process, self._log = process, log

    def tell(self, order: str) -> None:
        print(order, file=self._process.stdin, flush=True)

    def pause(self, seconds: float) -> None:
        """Let it stand still as on a machine that has no time for it."""
        self._process.send_signal(signal.SIGSTOP)
        sleep(seconds)
        self._process.send_signal(signal.SIGCONT)

    def stop(self) -> np.ndarray:
        """End it and return what was commanded: rows of time and q (7,)."""
        self.tell("stop")
        assert self._process.wait(20) == 0
        return np.load(self._log)


@contextmanager
def arm_peer(domain: int, log: Path) -> Iterator[ArmPeer]:
    command = [sys.executable, "-m", "ros2.tests.arm_peer", str(domain), str(log)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            yield ArmPeer(process, log)
        finally:
            process.kill()


def velocities(log: np.ndarray) -> np.ndarray:
    """Joint velocities (T, 7) between the rows of what was commanded [rad/s]."""
    return np.diff(log[:, 1:], axis=0) / np.diff(log[:, 0])[:, None]


def speeds(log: np.ndarray) -> np.ndarray:
    """Largest joint speeds (T,), likewise."""
    return np.abs(velocities(log)).max(axis=1)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
