"""Trajectories to a joint_trajectory_controller: it moves as commanded, and stands when nothing comes any more."""

import math
from collections.abc import Iterable, Sequence
from time import monotonic_ns, time_ns

import numpy as np

from pretouch.errors import RobotError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_ros2.inputs import JointReading
from pretouch_ros2.messages import TRAJECTORY
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams, parts
from pretouch_ros2.trajectory import Reference, TrajectoryPoint

_FRESH_S = 0.1
"""Age of a joint state up to which it tells where the arm is [s]."""
_PAST_S = 0.025
"""How much of its past a trajectory brings along, so that a controller whose clock is behind finds itself on it [s]."""
_LINGERS_S = 0.3
"""Time after a trajectory's end in which the arm comes to rest too [s]."""
_AGAIN_S = 10.0
"""Time in which an arm that was found elsewhere must not be so again [s]."""
_MEMORY = 0.995
"""Weight in the lag of what was seen a turn earlier."""
_UNKNOWN_RAD2_S2 = 0.5
"""Sum of squared velocities from which a lag begins to be known [rad^2/s^2]."""
_LARGEST_LAG_S = 0.1
"""Largest lag that is reckoned with [s]."""


class TrajectoryCommands:
    """Sends trajectory_msgs/JointTrajectory, each of which ends at rest; at rest it sends nothing.

    Each message decides alone where the arm is to be. So nothing must be sent in motion while the controller is
    elsewhere, as after messages were lost: it is left to come to rest, and begins anew where it then is.
    """

    def __init__(
        self, params: ArmParams, model: RobotModel, names: Sequence[str], node: Ros2Node, period: float
    ) -> None:
        """Take what to send, the arm, its joints as others call them, the node and the control period [s]."""
        self._params, self._names, self._messages = params, list(names), node.messages
        self.publisher = node.publisher(params.command_topic, TRAJECTORY)
        self._reference = Reference(model.description.qdd_max, period, params.hold_s)
        self._lag = Lag(model.description.qdd_max)
        self._ahead = params.ahead_s if params.shared_clock else 0.0
        self._settled = self._anew = -math.inf
        self._astray, self._located = False, False

    @property
    def begun(self) -> bool:
        """True if anything was sent."""
        return self._reference.begun

    @property
    def ends(self) -> float:
        """End of the last trajectory [s]."""
        return self._reference.ends + self._ahead

    def begin(self, joints: JointReading, now: float) -> float:
        """Begin at rest where the arm is; return how long that takes [s]. A RobotError if that is not known."""
        if not np.isfinite(joints.q).all():
            raise RobotError(
                f"The joint states are {joints.q}, not all finite, so the arm is not moved: check the arm's driver."
            )
        if not now - joints.stamp < _FRESH_S:
            raise RobotError(f"The joint states are {now - joints.stamp:.2f} s old: check that the arm's driver runs.")
        self._settle(joints.q, now)
        return self._params.settle_s + self._ahead

    def send(self, qd: FloatArray, now: float) -> None:
        """Send the next trajectory, which begins `ahead_s` after an instant [s]; none while the arm is to stand."""
        if now < self._settled or self._astray:
            return
        reference = self._reference
        if not np.any([qd, reference.motion_at(now)[1], reference.motion_at(now - _PAST_S)[1]]):
            return
        self._located = False
        passed = reference.passed(now, _PAST_S) if self._params.shared_clock else ()
        trajectory = reference.command(qd, now)
        self._publish((*passed, *trajectory.points()) if passed else trajectory.way_points(), now)

    def at(self, joints: JointReading, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities (n,) that were commanded by an instant [s]."""
        return self._reference.at(instant) if self.begun else (joints.q, np.zeros_like(joints.q))

    def check(self, joints: JointReading, now: float) -> None:
        """Look whether the arm is where it was sent. Far elsewhere is a RobotError; else it may begin anew."""
        if not self.begun or now < self._settled or not now - joints.stamp < _FRESH_S or np.isnan(joints.q).any():
            return
        reference, instant = self._reference, joints.stamp - self._ahead
        apart = np.abs(reference.motion_at(instant)[0] - joints.q)
        worst = int(np.argmax(apart))
        if not apart[worst] <= self._params.follow_most_rad:
            raise RobotError(self._elsewhere(worst, joints, instant))
        stray = self._lag.stray(reference, instant, joints.q)
        if now < reference.ends + self._ahead + _LINGERS_S:
            self._astray |= bool(stray.max() > self._params.stray_rad)
        elif not self._located and not self._astray:
            self._located = True
            self._lag.rest(reference, instant, joints.q)
        elif self._astray or stray.max() > self._params.stray_rad:
            if now < self._anew + _AGAIN_S:
                raise RobotError(self._elsewhere(int(np.argmax(stray)), joints, instant))
            self._anew, self._astray = now, False
            self._settle(joints.q, now)

    def _settle(self, q: FloatArray, now: float) -> None:
        """Bring the arm gently to rest at q (n,) [rad]."""
        self._settled, self._located = now + self._params.settle_s, False
        self._publish(self._reference.begin(q, now, self._params.settle_s).way_points(), now)

    def _elsewhere(self, joint: int, joints: JointReading, instant: float) -> str:
        return (
            f"The arm does not follow: {self._names[joint]} is at {joints.q[joint]:.3f} rad, but was commanded to"
            f" {self._reference.motion_at(instant)[0][joint]:.3f} rad: check that its controller runs and receives the"
            " commands, then start again from there."
        )

    def _publish(self, points: Iterable[TrajectoryPoint], began: float) -> None:
        points, make, nothing = tuple(points), self._messages.make, np.zeros(0)
        if not all(np.isfinite(p.q).all() and np.isfinite(p.qd).all() for p in points):
            raise RobotError("A trajectory is not finite, so it is not sent: check the arm's joint states.")
        # a stamp of zero means at once
        first, begin = 0.0, (0, 0)
        if self._params.shared_clock:
            first = min(points[0].time, 0.0)
            begin = parts_of_day(began + self._ahead + first)
        messages = []
        for p in points:
            since = make("builtin_interfaces/msg/Duration", *parts(p.time - first))
            messages.append(make("trajectory_msgs/msg/JointTrajectoryPoint", p.q, p.qd, nothing, nothing, since))
        self.publisher.publish(make(TRAJECTORY, self._messages.header(begin, ""), self._names, messages))


def parts_of_day(instant: float) -> tuple[int, int]:
    """Return the time of day, in seconds and nanoseconds, at an instant of the monotonic clock [s]."""
    looks = []
    for _ in range(3):
        before, day, after = monotonic_ns(), time_ns(), monotonic_ns()
        looks.append((after - before, day - (before + after) // 2))
    # the closest look: this thread may have had to wait between two clocks
    return divmod(min(looks)[1] + round(instant * 1e9), 10**9)


class Lag:
    """The time an arm is behind its commands, and its offset at rest, as learnt from its states.

    It tells whether the arm is where it was sent.
    """

    def __init__(self, qdd_max: FloatArray) -> None:
        """Take the acceleration limits (n,) [rad/s^2]."""
        self._qdd_max, self._offset = qdd_max, np.zeros_like(qdd_max)
        self._moved = self._behind = 0.0

    @property
    def seconds(self) -> float:
        """The lag [s]."""
        return min(max(self._behind / (self._moved + _UNKNOWN_RAD2_S2), 0.0), _LARGEST_LAG_S)

    def rest(self, reference: Reference, instant: float, q: FloatArray) -> None:
        """Take the offset (n,) [rad] of an arm at rest as its usual one."""
        self._offset = reference.motion_at(instant)[0] - q

    def stray(self, reference: Reference, instant: float, q: FloatArray) -> FloatArray:
        """Return how far (n,) [rad] the arm is from where it usually would be, less what is unknown of its lag."""
        lag = self.seconds
        usual, _ = reference.motion_at(instant - lag)
        target, qd = reference.motion_at(instant)
        unknown = _LARGEST_LAG_S * np.abs(qd) * _UNKNOWN_RAD2_S2 / (self._moved + _UNKNOWN_RAD2_S2)
        # a lag may be a delay, or that of a filter: they differ by this where the velocity changes
        distance = np.abs(usual - self._offset - q) - unknown - self._qdd_max * lag**2 / 2
        self._behind = _MEMORY * self._behind + float((target - self._offset - q) @ qd)
        self._moved = _MEMORY * self._moved + float(qd @ qd)
        return np.maximum(distance, 0.0)
