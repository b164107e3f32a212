"""Who commands the arm: an ordinary commander, and such as mean to hit the person; and what was left of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.control.joint_box import JointLimits
from pretouch.control.path import Path
from pretouch.desired import Desired, DesiredKind, joint_velocities, twist
from pretouch.params import FailureParams
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sound import sound_desired
from pretouch.types import FloatArray
from pretouch_lab.bench.obstacle import Shape, nearest

_DRIVE_M_S = 0.2, 1.5
"""Speeds at which a point of the arm is driven at the person [m/s]."""
_DAMPING = 0.05
"""Of the pseudo-inverse that drives it [m]."""
TOLERANCE = 1e-9
"""By how much a joint may pass a limit of position [rad], velocity [rad/s] or acceleration [rad/s, in a period] before
that counts: rounding."""


@dataclass(frozen=True)
class Situation:
    """What a commander may know: everything."""

    now: float
    """[s]"""
    model: RobotModel
    kin: Kinematics
    shape: Shape
    """The true surface of the person, or of what else is near."""
    person: FloatArray
    """(3,) its middle [m]."""
    velocity: FloatArray
    """(3,) how fast that moves [m/s]."""


Commander = Callable[[Situation], Desired | None]


class AtPerson:
    """Drives at the person on purpose, at a speed it draws: the hand, what is nearest, or one of the arm's capsules."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._way, self._part, self._speed = int(rng.integers(0, 3)), rng.random(), rng.uniform(*_DRIVE_M_S)

    def __call__(self, s: Situation) -> Desired:
        """See `Commander`."""
        if self._way == 0:
            way = s.person - s.kin.position[s.model.ee]
            return twist(s.now, self._speed * way / max(float(np.linalg.norm(way)), 1e-6))
        body = s.model.body if self._way == 1 else part_of(s.model.body, self._part)
        near = nearest(s.kin, body, s.shape)
        return _driven(s, near.link, near.point, self._speed * near.direction)


def part_of(body: Capsules, share: float) -> Capsules:
    """Return one of a body's capsules, from the first at 0 to the last at 1."""
    c = min(int(share * len(body.radius)), len(body.radius) - 1)
    return Capsules(body.link[c : c + 1], body.a[c : c + 1], body.b[c : c + 1], body.radius[c : c + 1])


def _driven(s: Situation, link: int, point: FloatArray, velocity: FloatArray) -> Desired:
    """Joint velocities that move a point (3,) of a link with a velocity (3,)."""
    J = s.model.jacobian(s.kin, link, point)[:3]
    return joint_velocities(s.now, J.T @ np.linalg.solve(J @ J.T + _DAMPING**2 * np.eye(3), velocity))


class Tracking:
    """An ordinary one: resolved rate along a path by the clock, whoever is in the way."""

    def __init__(self, path: Path, speed: float, gain: float, fastest: float) -> None:
        """Take the path, how fast its point moves [m/s], the gain [1/s] and the largest speed [m/s]."""
        self._path, self._speed, self._gain, self._fastest = path, speed, gain, fastest

    def wanted(self, now: float) -> FloatArray:
        """Return where the hand should be at a time (3,) [m]."""
        return self._path.point(self._phase(now))

    def _phase(self, now: float) -> float:
        return self._speed * now if self._path.closed else min(self._speed * now, self._path.length)

    def __call__(self, s: Situation) -> Desired:
        """See `Commander`."""
        ahead = (self.wanted(s.now + 0.01) - self.wanted(s.now)) / 0.01
        velocity = ahead + self._gain * (self.wanted(s.now) - s.kin.position[s.model.ee])
        size = float(np.linalg.norm(velocity))
        return twist(s.now, velocity * min(1.0, self._fastest / max(size, 1e-9)))


def asked_velocity(asked: Desired | None, now: float, model: RobotModel, kin: Kinematics) -> FloatArray | None:
    """Velocity (3,) of the end-effector origin that is asked for [m/s]; None if nothing sound and new is."""
    sound, _ = sound_desired(asked, model.n, now)
    if sound is None or now - sound.stamp[-1] > FailureParams().desired_timeout_s:
        return None
    if sound.kind is DesiredKind.TWIST:
        return sound.number[0, :3]
    if sound.kind is DesiredKind.JOINT_VELOCITIES:
        return np.asarray(model.ee_jacobian(kin)[:3] @ sound.number[0])
    return None


def breaks_limits(q: FloatArray, before: FloatArray, command: FloatArray, limits: JointLimits) -> bool:
    """Whether a command breaks a limit of a joint.

    Args:
        q: (n,) commanded positions when it ends [rad].
        before: (n,) command before it [rad/s].
        command: (n,) [rad/s].
        limits: those of the controller, its margin at the ends of the joints included.
    """
    slow = np.abs(command) <= limits.qd_max + TOLERANCE
    smooth = np.abs(command - before) <= limits.qdd_max * limits.period + TOLERANCE
    inside = (q >= limits.q_min - TOLERANCE) & (q <= limits.q_max + TOLERANCE)
    return not bool((slow & smooth & inside).all())
