"""What arms, units and commanders send in tests, a commander that goes on sending, and a controller that is turned."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from time import time
from types import SimpleNamespace
from typing import Any

import numpy as np

from pretouch import loop
from pretouch.controller import Controller
from pretouch.types import ControlStep
from pretouch_ros2.messages import JOINT_STATE, RANGE, TRAJECTORY, TWIST, WireMessages
from pretouch_ros2.node import Ros2Node

MESSAGES = WireMessages("jazzy")
NAMES = tuple(f"panda_joint{i}" for i in range(1, 8))
SLOW = np.full(7, 0.05)


def stamp(seconds: float) -> tuple[int, int]:
    return math.floor(seconds), round(seconds % 1 * 1e9)


def header(at: float, frame: str = "f") -> Any:
    return MESSAGES.header(stamp(at), frame)


def joint_state(at: float, names: Sequence[str], q: Any = (), qd: Any = (), tau: Any = ()) -> Any:
    return MESSAGES.make(JOINT_STATE, header(at), list(names), *(np.array(one, float) for one in (q, qd, tau)))


def measured_range(at: float, name: str, distance: float, least: float = 0.04, most: float = 4.0) -> Any:
    return MESSAGES.make(RANGE, header(at, name), 1, 0.47, least, most, distance, 0.0)


def twist(linear: Any, angular: Any = (0, 0, 0), frame: str = "panda_link0", at: float | None = None) -> Any:
    pair = MESSAGES.xyz("Vector3", linear), MESSAGES.xyz("Vector3", angular)
    at = time() if at is None else at
    return MESSAGES.make(TWIST, header(at, frame), MESSAGES.make("geometry_msgs/msg/Twist", *pair))


def trajectory(names: tuple[str, ...], *points: tuple[float, Any], at: float = 0.0) -> Any:
    """Points of a time [s] and velocities."""
    none, make = np.zeros(0), MESSAGES.make
    made = [
        make("trajectory_msgs/msg/JointTrajectoryPoint", none, np.asarray(qd, float), none, none,
             make("builtin_interfaces/msg/Duration", *stamp(after)))
        for after, qd in points
    ]  # fmt: skip
    return make(TRAJECTORY, header(at, ""), list(names), made)


@contextmanager
def publishing(node: Ros2Node, topic: str, kind: str, made: Callable[[], Any]) -> Iterator[None]:
    """Be a commander's program: send a message again and again, stamped as it goes."""
    publisher, over = node.publisher(topic, kind), Event()

    def send() -> None:
        while not over.wait(0.02):
            publisher.publish(made())

    thread = Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def turned(
    controller: Controller, robot: Any, units: Any, done: Callable[[ControlStep], bool], **options: Any
) -> list[ControlStep]:
    """Turn a controller over an arm until `done(step)`, or for 30 s; return the steps."""
    steps: list[ControlStep] = []
    kept = SimpleNamespace(record=lambda cycle: steps.append(cycle.step))

    def over(step: ControlStep) -> bool:
        return done(step) or len(steps) > 3000

    loop.run(controller, robot, units, loop.MonotonicClock(0.01), kept, over, loop.Options(**options))
    return steps
