"""Topics for viewers that do not know our messages: standard types, transforms and markers."""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from pretouch.controller import Controller
from pretouch.recording.disk import Item
from pretouch.recording.ros import JOINT_STATE, MARKERS, RANGE, TRANSFORMS, WRENCH, messages
from pretouch.recording.simulation import surroundings
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.types import ControlStep, FloatArray, Inputs, RangeReadings, RangeStatus

KINDS = (JOINT_STATE, WRENCH, RANGE, TRANSFORMS, MARKERS)
"""Types of these topics."""

_LATEST = (2**31 - 1) * 10**9
"""Latest time a ROS message can hold [ns]."""
_INFRARED = 1
_ACCURACY_M = 0.025
"""Ranging error of the VL53L1X, at most [m] (data sheet DS12385)."""
_MEASURED = (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED)
_PERIOD_NS = 33_000_000
"""Least time between two drawings [ns]: about 30 a second."""
_CUBE, _SPHERE, _CYLINDER, _LINE_STRIP, _LINE_LIST, _SPHERE_LIST = 1, 2, 3, 4, 5, 7
_GREY, _BROWN = (0.8, 0.8, 0.8, 0.6), (0.6, 0.45, 0.3, 0.8)
_SENSED = _SPHERE_LIST, (0.03, 0.03, 0.03), (0.1, 0.8, 0.2, 1.0)
_CLOSEST = _LINE_LIST, (0.005, 0.0, 0.0), (0.9, 0.2, 0.2, 1.0)
_PATH = _LINE_STRIP, (0.005, 0.0, 0.0), (0.2, 0.4, 0.9, 1.0)
_PATH_POINTS = 200


def nanoseconds(stamp: float, instead: int) -> int:
    """Return a stamp [s] in ns, within what ROS and MCAP can hold; one that is no number as `instead`."""
    if stamp != stamp:
        return instead
    return round(min(max(stamp, 0.0), _LATEST / 1e9) * 1e9)


def header(time: int, frame: str) -> Any:
    """Return a ROS header for an instant [ns] and a frame."""
    return messages().header(divmod(time, 10**9), frame)


@cache
def topic_name(name: str) -> str:
    """Return a unit's id as ROS allows it in a topic: ASCII letters, digits and underscores, no digit first."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in name)
    return f"_{plain}" if plain[0].isdigit() else plain


class ViewerTopics:
    """Makes the cycles of one controller into standard topics, in another thread than the controller's."""

    def __init__(self, controller: Controller, about: Mapping[str, Any], model: RobotModel) -> None:
        """Take a controller, the caller's facts, and a model of the same arm for that thread alone."""
        import scipy.spatial.transform  # noqa: F401  now, not while a loop runs: it takes a fifth of a second

        self._model, self._skin = model, controller.skin
        phases = np.linspace(0.0, controller.path.length, _PATH_POINTS)
        self._path = np.array([controller.path.point(phase) for phase in phases.tolist()], dtype=np.float64)
        self._boxes = surroundings(about).boxes
        self._base, self._joints = model.links[0], list(model.joints)
        self._newest = np.full(len(controller.skin), -np.inf)
        self._drawn: int | None = None

    def items(self, inputs: Inputs | None, step: ControlStep, sequence: int, time: int) -> Iterator[Item]:
        """Yield the messages of one cycle at an instant [ns]; without the inputs those that a step can tell."""
        at = header(time, self._base)
        torque = np.zeros(3)
        qd = effort = np.zeros(0)
        if inputs is not None:
            qd, effort = _fitting(inputs.robot.qd, step.q), _fitting(inputs.robot.tau_ext, step.q)
            wrench = inputs.robot.wrench
            if wrench is not None and wrench.shape == (6,):
                torque = wrench[3:]
            yield from self._ranges(inputs.readings, sequence, time)
        yield item("/joint_states", JOINT_STATE, sequence, time, at, self._joints, step.q, qd, effort)
        if step.force[0] == step.force[0]:
            vectors = messages().xyz("Vector3", step.force), messages().xyz("Vector3", torque)
            both = messages().make("geometry_msgs/msg/Wrench", *vectors)
            yield item("/wrench", WRENCH, sequence, time, at, both)
        yield from self._drawings(step, sequence, time)

    def _ranges(self, readings: RangeReadings, sequence: int, time: int) -> Iterator[Item]:
        """Yield a message for each unit whose reading is not the one before."""
        stamps, distances, statuses = readings.stamp, readings.distance, readings.status
        if not len(stamps) == len(distances) == len(statuses) == len(self._skin):
            return
        fresh = np.flatnonzero((stamps != self._newest) & np.isfinite(stamps))
        self._newest = stamps
        for k in fresh.tolist():
            reading = float(stamps[k]), float(distances[k]), int(statuses[k])
            unit = self._skin.units[k]
            yield range_item(unit.id, sequence, time, *reading, unit.sensor)

    def _drawings(self, step: ControlStep, sequence: int, time: int) -> Iterator[Item]:
        """Yield what is to be drawn of a step; nothing so soon after another."""
        if self._drawn is None:
            at, poses = divmod(time, 10**9), [(u.link, u.id, u.T_link_sensor) for u in self._skin.units]
            places = [messages().transform(at, link, name, T[:3, 3], T[:3, :3]) for link, name, T in poses]
            yield item("/tf_static", TRANSFORMS, sequence, time, places)
            yield item("/markers/scene", MARKERS, sequence, time, self._standing(time))
        elif 0 <= time - self._drawn < _PERIOD_NS:
            return
        self._drawn = time
        if np.isfinite(step.q).all():
            yield item("/tf", TRANSFORMS, sequence, time, self._frames(step.q, time))
        yield item("/markers", MARKERS, sequence, time, self._sensed(step, time))

    def _frames(self, q: FloatArray, time: int) -> list[Any]:
        kin, links, at = self._model.kinematics(q), self._model.links, divmod(time, 10**9)
        poses = zip(links[1:], kin.position[1:], kin.rotation[1:], strict=True)
        return [messages().transform(at, links[0], link, p, R) for link, p, R in poses]

    def _sensed(self, step: ControlStep, time: int) -> list[Any]:
        """Sensed points as spheres, and the closest pairs as lines."""
        obstacles, at = step.obstacles, header(time, self._base)
        pairs = np.stack([obstacles.body_point, obstacles.point], axis=1).reshape(-1, 3)
        return [
            messages().marker(at, _SENSED, points=obstacles.point, ns="sensed", frame_locked=True),
            messages().marker(at, _CLOSEST, points=pairs, ns="closest", frame_locked=True),
        ]

    def _standing(self, time: int) -> list[Any]:
        """The path, the arm's capsules in the frames of their links, and boxes around it."""
        base = header(time, self._base)
        markers = [messages().marker(base, _PATH, points=self._path, ns="path", frame_locked=True)]
        markers += _capsule_markers(self._model.capsules, self._model.links, time)
        for i, box in enumerate(self._boxes):
            look = _CUBE, tuple(2 * box.half_size), _BROWN
            markers.append(messages().marker(base, look, box.center, ns="box", id=i, frame_locked=True))
        return markers


def range_item(
    unit_id: str, sequence: int, time: int, stamp: float, distance: float, status: int, sensor: Sensor = PAPER_SENSOR
) -> Item:
    """Return a unit's reading measured at a stamp [s], logged at an instant [ns]: distance [m] and `RangeStatus`."""
    at = header(nanoseconds(stamp, time), unit_id)
    with np.errstate(over="ignore"):  # what float32 cannot hold is infinite
        seen_m = float(np.float32(distance)) if status in _MEASURED else math.inf
    sees = sensor.angle, sensor.nearest_m, sensor.farthest_m
    topic = f"/skin/{topic_name(unit_id)}/range"
    return item(topic, RANGE, sequence, time, at, _INFRARED, *sees, seen_m, _ACCURACY_M**2)


def item(topic: str, kind: str, sequence: int, time: int, *fields: Any) -> Item:
    """Return a message of these fields, logged at an instant [ns]."""
    return Item(topic, kind, sequence, time, messages().encoded(kind, messages().make(kind, *fields)))


def _capsule_markers(capsules: Capsules, links: tuple[str, ...], time: int) -> list[Any]:
    """Return a cylinder and two spheres for each capsule."""
    from scipy.spatial.transform import Rotation  # loaded by `ViewerTopics`

    markers = []
    for i, (link, a, b, r) in enumerate(
        zip(capsules.link.tolist(), capsules.a, capsules.b, capsules.radius.tolist(), strict=True)
    ):
        at, along = header(time, links[link]), b - a
        length = float(np.linalg.norm(along))
        turn = Rotation.align_vectors([along / length], [[0.0, 0.0, 1.0]])[0] if length else Rotation.identity()
        ball, middle = (_SPHERE, (2 * r, 2 * r, 2 * r), _GREY), (_CYLINDER, (2 * r, 2 * r, length), _GREY)
        shapes = (middle, (a + b) / 2, turn.as_quat()), (ball, a, (0, 0, 0, 1)), (ball, b, (0, 0, 0, 1))
        markers += [
            messages().marker(at, *shape, ns="arm", id=3 * i + k, frame_locked=True) for k, shape in enumerate(shapes)
        ]
    return markers


def _fitting(array: FloatArray, like: FloatArray) -> FloatArray:
    """Return an array of float64 if it is as long as another one, and else an empty one."""
    return array if array.shape == like.shape and array.dtype == np.float64 else np.zeros(0)
