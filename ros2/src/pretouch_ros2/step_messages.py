"""A control step as standard messages, for RViz, PlotJuggler and the like."""

import math
from typing import Any

import numpy as np

from pretouch.controller import Controller
from pretouch.explanation import Limit
from pretouch.loop import Cycle
from pretouch.types import ControlStep, FloatArray, Mode, RangeReadings, RangeStatus
from pretouch_ros2.messages import CLOUD, DIAGNOSTICS, STATUS, TRANSFORMS, WRENCH, WireMessages

Stamp = tuple[int, int]
"""Seconds and nanoseconds."""
_POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("distance", "<f4"), ("unit", "<u4"), ("age", "<f4")])
"""An obstacle: position [m], distance from the body's surface [m], unit that saw it last, and time since then [s]."""
_FLOAT32, _UINT32 = 7, 6
"""Codes of sensor_msgs/PointField."""
_OK, _WARN, _ERROR = 0, 1, 2
_LEVEL = {Mode.TRACK: _OK, Mode.REACT: _OK, Mode.HOLD: _WARN}


class StepMessages:
    """Makes messages of the steps of one controller."""

    def __init__(self, controller: Controller, messages: WireMessages, base_frame: str) -> None:
        self._m = messages
        self._skin, self._sight = controller.skin, controller.profile.sight
        self.base = base_frame or controller.model.links[0]
        self._links, self._joints = (self.base, *controller.model.links[1:]), controller.model.joints

    def cloud(self, step: ControlStep, at: Stamp) -> Any:
        """Obstacles as a point cloud in the base frame."""
        obstacles = step.obstacles
        points = np.zeros(len(obstacles.point), dtype=_POINT)
        for i, name in enumerate("xyz"):
            points[name] = obstacles.point[:, i]
        points["distance"], points["unit"], points["age"] = obstacles.body_distance, obstacles.unit, obstacles.age
        fields = [
            self._m.make("sensor_msgs/msg/PointField", name, of[1], _UINT32 if name == "unit" else _FLOAT32, 1)
            for name, of in (_POINT.fields or {}).items()
        ]
        data, size = np.frombuffer(points.tobytes(), dtype=np.uint8), _POINT.itemsize
        return self._m.make(CLOUD, self._header(at), 1, len(points), fields, False, size, len(data), data, True)

    def wrench(self, force: FloatArray, at: Stamp) -> Any:
        """A force (3,) [N] on the robot, base frame; NaN where there is no estimate."""
        pair = self._m.xyz("Vector3", force), self._m.xyz("Vector3", np.zeros(3))
        return self._m.make(WRENCH, self._header(at), self._m.make("geometry_msgs/msg/Wrench", *pair))

    def units(self, at: Stamp) -> Any:
        """Poses of the units on their links."""
        skin = self._skin
        places = zip(skin.link, skin.ids, skin.T_link_sensor, strict=True)
        frames = [self._m.transform(at, self._links[link], name, T[:3, 3], T[:3, :3]) for link, name, T in places]
        return self._m.make(TRANSFORMS, frames)

    def limited(self, step: ControlStep) -> Any:
        """Restrictions that limited a requested motion, for its sender: `ControlStep.limited` by name."""
        of = step.limited
        names = {"unit": self._skin.ids, "link": self._links, "joint": self._joints}
        places = {"unit": of.unit, "link": of.link, "joint": of.joint}
        values = {"by": of.by.value, "share": f"{of.share:.3f}"} | {
            key: names[key][at] if 0 <= at < len(names[key]) else "" for key, at in places.items()
        }
        return self._status("pretouch: limited", _OK if of.by is Limit.NOTHING else _WARN, step.reason, "", values)

    def diagnostics(self, cycle: Cycle, at: Stamp) -> Any:
        """Mode and reason, and how old each unit's newest reading is."""
        step = cycle.step
        values = {"speed scale": f"{step.speed_scale:.3f}", "armed": str(step.armed), "QP": step.qp.status}
        first = self._status("pretouch: controller", _LEVEL[step.mode], f"{step.mode.name}: {step.reason}", "", values)
        return self._m.make(DIAGNOSTICS, self._header(at), [first, *self._unit_statuses(cycle.inputs.readings, step)])

    def _unit_statuses(self, readings: RangeReadings, step: ControlStep) -> list[Any]:
        if not len(readings.stamp) == len(readings.status) == len(self._skin):
            return []
        slow, silent = self._sight.slow_after_s, self._sight.silent_after_s
        statuses = []
        for name, stamp, code in zip(self._skin.ids, readings.stamp.tolist(), readings.status.tolist(), strict=True):
            age = step.stamp - stamp
            level = _OK if age < slow else _WARN if age < silent else _ERROR
            sentence = "never heard" if math.isinf(age) else f"received {age:.2f} s ago"
            status = RangeStatus(code).name if code in set(RangeStatus) else str(code)
            statuses.append(self._status(f"pretouch: unit {name}", level, sentence, name, {"status": status}))
        return statuses

    def _status(self, name: str, level: int, sentence: str, hardware: str, values: dict[str, str]) -> Any:
        pairs = [self._m.make("diagnostic_msgs/msg/KeyValue", *pair) for pair in values.items()]
        return self._m.make(STATUS, level, name, sentence, hardware, pairs)

    def _header(self, at: Stamp) -> Any:
        return self._m.header(at, self.base)
