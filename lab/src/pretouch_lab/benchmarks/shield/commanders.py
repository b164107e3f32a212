"""Who commands the arm: an ordinary commander, wild ones, and such as mean to hit the person."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from pretouch.control.path import Path
from pretouch.desired import Desired, DesiredKind, joint_velocities, twist
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.avoidance.obstacle import Shape, nearest

_EXTREME = 3.0
"""Times the joints' speed limits that wild commanders ask for, and as many m/s."""
_HELD = 7
"""Steps for which one of them asks for the same at most."""
_DRIVE_M_S = 0.2, 1.5
"""Speeds at which a point of the arm is driven at the person [m/s]."""
_DAMPING = 0.05
"""Of the pseudo-inverse that drives it [m]."""


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


class Noise:
    """Uniform noise, new in each step: joint velocities or a twist."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def __call__(self, s: Situation) -> Desired:
        """See `Commander`."""
        return _at(s, self._rng.uniform(-1.0, 1.0, 13))


class Extremes:
    """One extreme after the other, each for some steps."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self._left, self._share = rng, 0, np.ones(13)

    def __call__(self, s: Situation) -> Desired:
        """See `Commander`."""
        if self._left == 0:
            self._left = int(self._rng.integers(1, _HELD))
            self._share = -self._share if self._rng.random() < 0.7 else self._rng.choice([-1.0, 1.0], 13)
        self._left -= 1
        return _at(s, self._share)


def _at(s: Situation, share: FloatArray) -> Desired:
    """Ask for shares (13,) of the largest: of a twist where the last is positive, else of joint velocities."""
    if share[-1] > 0.0:
        return twist(s.now, _EXTREME * share[:3], _EXTREME * share[3:6])
    return joint_velocities(s.now, _EXTREME * s.model.description.qd_max * share[: s.model.n])


class Nonsense:
    """What is no desired motion, or an old one, half the time; between them `Extremes`."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self._left, self._broken = rng, 0, _BROKEN[0]
        self._sound = Extremes(rng)

    def __call__(self, s: Situation) -> Desired | None:
        """See `Commander`."""
        if self._left == 0:
            self._left = int(self._rng.integers(1, _HELD))
            which = int(self._rng.integers(0, 2 * len(_BROKEN)))
            self._broken = _BROKEN[which] if which < len(_BROKEN) else None
        self._left -= 1
        return self._sound(s) if self._broken is None else self._broken(s)


def _filled(value: float) -> Callable[[Situation], Desired]:
    return lambda s: joint_velocities(s.now, np.full(s.model.n, value))


def _stamped(stamp: Callable[[float], float]) -> Callable[[Situation], Desired]:
    return lambda s: joint_velocities(stamp(s.now), s.model.description.qd_max)


def _raw(make: Callable[[Situation], object]) -> Callable[[Situation], Desired]:
    return make  # type: ignore[return-value]  # what no program with types would send


_BROKEN: tuple[Callable[[Situation], Desired | None] | None, ...] = (
    *(_filled(value) for value in (np.nan, np.inf, -np.inf, 1e300, 999.0, 1e-320)),
    *(_stamped(stamp) for stamp in (lambda t: t - 5.0, lambda t: t - 0.08, lambda t: t + 1.0, lambda t: t + 1e6)),
    *(_stamped(stamp) for stamp in (lambda _: np.nan, lambda _: -np.inf, lambda _: 0.0)),
    _raw(lambda s: Desired(DesiredKind.TWIST, np.array([s.now]), np.ones((1, 3)))),
    _raw(lambda s: Desired(DesiredKind.JOINT_VELOCITIES, np.array([s.now, s.now]), np.ones((2, s.model.n)))),
    _raw(lambda s: Desired(DesiredKind.JOINT_POSITIONS, np.zeros(0), np.zeros((0, s.model.n)))),
    _raw(lambda s: Desired(DesiredKind.POSE, np.array([s.now]), np.ones((1, 12)))),
    _raw(lambda s: Desired(17, np.array([s.now]), np.ones((1, 6)))),  # type: ignore[arg-type]
    _raw(lambda s: Desired(DesiredKind.TWIST, "now", "fast")),  # type: ignore[arg-type]
    _raw(lambda s: Desired(DesiredKind.TWIST, np.array([s.now]), np.array([["a"] * 6]))),
    _raw(lambda s: Desired(DesiredKind.TWIST, np.array([s.now]), None)),  # type: ignore[arg-type]
    _raw(lambda s: "forward"),
    _raw(lambda s: 1.0),
    lambda s: None,
)
"""Each sends something else that is none, is old, or is of another clock; None: the path."""


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
    c = min(int(share * len(body)), len(body) - 1)
    return Capsules(body.link[c : c + 1], body.a[c : c + 1], body.b[c : c + 1], body.radius[c : c + 1])


def _driven(s: Situation, link: int, point: FloatArray, velocity: FloatArray) -> Desired:
    """Joint velocities that move a point (3,) of a link with a velocity (3,)."""
    J = s.model.jacobian(s.kin, link, point)[:3]
    return joint_velocities(s.now, J.T @ np.linalg.solve(J @ J.T + _DAMPING**2 * np.eye(3), velocity))


@dataclass(frozen=True)
class Attack:
    """Parameters of a commander that learns to hit hard, each a share in [0, 1] of the range beside it."""

    lead: float
    """How far ahead it aims at where the person goes: to 0.5 s."""
    speed: float
    """0.2 to 2 m/s."""
    dash: float
    """Distance of the person at which it starts: 0.05 to 1.2 m; before, it stands."""
    aside_x: float
    aside_y: float
    aside_z: float
    """Where it comes from: what it aims at lies up to 0.3 m beside the person, the less the nearer it is."""
    part: float
    """Which capsule of the arm it drives, from the base to the hand."""
    sway: float
    """Speed across its way, to 1 m/s at 2 Hz: units look elsewhere."""


GENES = len(fields(Attack))


class Learned:
    """Attacks with given parameters; `search` finds them."""

    def __init__(self, attack: Attack) -> None:
        self._p = attack

    def __call__(self, s: Situation) -> Desired:
        """See `Commander`."""
        p, part = self._p, part_of(s.model.body, self._p.part)
        link = int(part.link[0])
        point = s.kin.position[link] + s.kin.rotation[link] @ (0.5 * (part.a[0] + part.b[0]))
        to_person = s.person + 0.5 * p.lead * s.velocity - point
        distance = float(np.linalg.norm(to_person))
        if distance > 0.05 + 1.15 * p.dash:
            return joint_velocities(s.now, np.zeros(s.model.n))
        beside = 0.6 * (np.array([p.aside_x, p.aside_y, p.aside_z]) - 0.5)
        way = to_person + min(1.0, 2.0 * distance) * beside
        ahead = way / max(float(np.linalg.norm(way)), 1e-6)
        across = np.cross(ahead, [0.0, 0.0, 1.0]) * p.sway * np.sin(4.0 * np.pi * s.now)
        return _driven(s, link, point, (0.2 + 1.8 * p.speed) * ahead + across)


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
