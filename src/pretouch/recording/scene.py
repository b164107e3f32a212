"""What viewers draw of a recording: where the links are, and markers of what the arm senses and follows."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from pretouch.controller import Controller
from pretouch.recording.disk import Item
from pretouch.recording.messages import encoded, make
from pretouch.recording.standard import HEADER, QUATERNION, TIME, VECTOR, header, vector
from pretouch.recording.surroundings import surroundings
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.types import ControlStep, FloatArray

TF, MARKERS = "tf2_msgs/msg/TFMessage", "visualization_msgs/msg/MarkerArray"
DRAWN = (TF, MARKERS)
"""Types that are drawn."""
_STAMPED, _TRANSFORM = "geometry_msgs/msg/TransformStamped", "geometry_msgs/msg/Transform"
_MARKER, _POSE, _POINT = "visualization_msgs/msg/Marker", "geometry_msgs/msg/Pose", "geometry_msgs/msg/Point"
_COLOR, _DURATION = "std_msgs/msg/ColorRGBA", "builtin_interfaces/msg/Duration"
_IMAGE, _MESH = "sensor_msgs/msg/CompressedImage", "visualization_msgs/msg/MeshFile"

_PERIOD_NS = 33_000_000
"""Least time between two drawings [ns]: about 30 a second."""
_CUBE, _SPHERE, _CYLINDER, _LINE_STRIP, _LINE_LIST, _SPHERE_LIST = 1, 2, 3, 4, 5, 7
_GREEN, _RED, _BLUE, _GREY, _BROWN = (
    (0.1, 0.8, 0.2, 1.0), (0.9, 0.2, 0.2, 1.0), (0.2, 0.4, 0.9, 1.0), (0.8, 0.8, 0.8, 0.6), (0.6, 0.45, 0.3, 0.8),
)  # fmt: skip
_POINT_M, _LINE_M = 0.03, 0.005
_PATH_POINTS = 200


class _Look(NamedTuple):
    """What a marker looks like."""

    kind: int
    size: tuple[float, ...]
    """(3,) [m]"""
    color: tuple[float, ...]
    """(4,) red, green, blue, opacity."""


_SENSED = _Look(_SPHERE_LIST, (_POINT_M, _POINT_M, _POINT_M), _GREEN)
_CLOSEST = _Look(_LINE_LIST, (_LINE_M, 0.0, 0.0), _RED)
_PATH = _Look(_LINE_STRIP, (_LINE_M, 0.0, 0.0), _BLUE)


class Scene:
    """Draws the steps of one controller, in another thread than the controller's."""

    def __init__(self, controller: Controller, about: Mapping[str, Any], model: RobotModel) -> None:
        """Take a controller, the caller's facts, and a model of the same arm for that thread alone."""
        import scipy.spatial.transform  # noqa: F401  now, not while a loop runs: it takes a fifth of a second

        self._model = model
        self._skin = controller.skin
        self._path = _sampled(controller)
        self._boxes = surroundings(about).boxes
        self._drawn: int | None = None

    def drawn(self, step: ControlStep, sequence: int, time: int) -> Iterator[Item]:
        """Yield what is to be drawn of a step at an instant [ns]; nothing so soon after another."""
        if self._drawn is None:
            yield Item("/tf_static", TF, sequence, time, self._sensors(time))
            yield Item("/markers/scene", MARKERS, sequence, time, self._standing(time))
        elif 0 <= time - self._drawn < _PERIOD_NS:
            return
        self._drawn = time
        if np.isfinite(step.q).all():
            yield Item("/tf", TF, sequence, time, self._links(step.q, time))
        yield Item("/markers", MARKERS, sequence, time, self._sensed(step, time))

    def _links(self, q: FloatArray, time: int) -> bytes:
        kin, links = self._model.kinematics(q), self._model.links
        turns = _quaternions(kin.rotation[1:])
        at = header(time, links[0])
        frames = [
            make(_STAMPED, at, link, make(_TRANSFORM, vector(p), turn))
            for link, p, turn in zip(links[1:], kin.position[1:], turns, strict=True)
        ]
        return encoded(TF, make(TF, frames))

    def _sensors(self, time: int) -> bytes:
        units = self._skin.units
        turns = _quaternions(self._skin.T_link_sensor[:, :3, :3])
        frames = [
            make(_STAMPED, header(time, u.link), u.id, make(_TRANSFORM, vector(u.T_link_sensor[:3, 3]), turn))
            for u, turn in zip(units, turns, strict=True)
        ]
        return encoded(TF, make(TF, frames))

    def _sensed(self, step: ControlStep, time: int) -> bytes:
        """Sensed points as spheres, and the closest pairs as lines."""
        o, at = step.obstacles, header(time, self._model.links[0])
        pairs = np.stack([o.body_point, o.point], axis=1).reshape(-1, 3)
        return encoded(MARKERS, make(MARKERS, [
            _marker(at, "sensed", 0, _SENSED, points=o.point),
            _marker(at, "closest", 0, _CLOSEST, points=pairs),
        ]))  # fmt: skip

    def _standing(self, time: int) -> bytes:
        """The path, the arm's capsules in the frames of their links, and boxes around it."""
        base = header(time, self._model.links[0])
        markers = [_marker(base, "path", 0, _PATH, points=self._path)]
        markers += _capsule_markers(self._model.capsules, self._model.links, time)
        for i, box in enumerate(self._boxes):
            markers.append(_marker(base, "box", i, _Look(_CUBE, tuple(2 * box.half_size), _BROWN), box.center))
        return encoded(MARKERS, make(MARKERS, markers))


def _capsule_markers(capsules: Capsules, links: tuple[str, ...], time: int) -> list[Any]:
    """Return a cylinder and two spheres for each capsule."""
    from scipy.spatial.transform import Rotation  # loaded by `Scene`

    markers = []
    for i, (link, a, b, r) in enumerate(
        zip(capsules.link.tolist(), capsules.a, capsules.b, capsules.radius.tolist(), strict=True)
    ):
        at, along = header(time, links[link]), b - a
        length = float(np.linalg.norm(along))
        turn = Rotation.align_vectors([along / length], [[0.0, 0.0, 1.0]])[0] if length else Rotation.identity()
        ball, middle = _Look(_SPHERE, (2 * r, 2 * r, 2 * r), _GREY), _Look(_CYLINDER, (2 * r, 2 * r, length), _GREY)
        markers += [
            _marker(at, "arm", 3 * i, middle, (a + b) / 2, turn.as_quat()),
            _marker(at, "arm", 3 * i + 1, ball, a),
            _marker(at, "arm", 3 * i + 2, ball, b),
        ]
    return markers


def _marker(
    at: Any, group: str, number: int, look: _Look, position: FloatArray | None = None,
    quaternion: FloatArray | None = None, points: FloatArray | None = None,
) -> Any:  # fmt: skip
    """Make a marker; quaternions are (x, y, z, w), as in ROS."""
    place = [0.0, 0.0, 0.0] if position is None else [float(v) for v in position]
    turn = [0.0, 0.0, 0.0, 1.0] if quaternion is None else [float(v) for v in quaternion]
    corners = [] if points is None else [make(_POINT, *p) for p in points.tolist()]
    nothing = np.zeros(0, dtype=np.uint8)
    empty = make(HEADER, make(TIME, 0, 0), "")
    return make(
        _MARKER, at, group, number, look.kind, 0, make(_POSE, make(_POINT, *place), make(QUATERNION, *turn)),
        make(VECTOR, *(float(v) for v in look.size)), make(_COLOR, *look.color), make(_DURATION, 0, 0), True, corners,
        [], "", make(_IMAGE, empty, "", nothing), [], "", "", make(_MESH, "", nothing), False,
    )  # fmt: skip


def _quaternions(rotations: FloatArray) -> list[Any]:
    from scipy.spatial.transform import Rotation  # loaded by `Scene`

    if not len(rotations):
        return []
    return [make(QUATERNION, *q) for q in Rotation.from_matrix(rotations).as_quat().tolist()]


def _sampled(controller: Controller) -> FloatArray:
    phases = np.linspace(0.0, controller.path.length, _PATH_POINTS)
    return np.array([controller.path.point(phase) for phase in phases.tolist()], dtype=np.float64)
