"""What a fuzzed controller is made of: profile, skin, fixtures, path, and where the arm starts."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass, replace
from types import NoneType, UnionType
from typing import Literal, get_args, get_origin

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.checks import Checked, hints_of
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import DecayingVelocity
from pretouch.control.approach import ApproachRestriction
from pretouch.control.path import Circle, Path, WayPoints, segment
from pretouch.errors import ParameterError
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import Profile, profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from tests.reference.skins import spread

ONLY = {"control_period_s": (0.01, 0.001), "samples": (2, 5, 30), "solver_iterations": (500,)}
"""Parameters that have only these values."""
SOON = {"samples": 5, "restore_cycles": 20, "decay_cycles": 20, "quiet_s": 0.05, "patience_s": 0.1, "retry_s": 0.3}
"""What is usual here in place of what a profile says, so that much happens in few steps."""
BASES = ("pretouch", "pretouch", "paper")
"""Profiles whose parts and parameters are drawn."""
USUAL = (1.0, 0.85, 0.85, 0.4, 0.4, 0.4)
"""Shares of parameters that are the usual ones, of which one is drawn for each profile."""
FAR = 30.0
"""How many times a parameter is as large, or as small, as usual."""


@dataclass(frozen=True)
class World:
    """One arm's controller and the state the arm is in when it takes over."""

    model: RobotModel
    profile: Profile
    skin: Skin
    fixtures: Fixtures
    path: Path
    q: np.ndarray
    qd: np.ndarray
    lying: bool
    """Whether the arm's interface also gives finite numbers that are not true."""
    measured_off: float
    """Spread of the measured about the commanded joint positions [rad]."""


def any_world(rng: np.random.Generator, model: RobotModel) -> World:
    """Draw a world."""
    chosen = any_profile(rng)
    q, qd = any_start(rng, model, chosen.task.position_margin_rad)
    return World(
        model, chosen, any_skin(rng, model), any_fixtures(rng), any_path(rng, model, q), q, qd,
        lying=rng.random() < 0.15, measured_off=float(rng.choice([0.0, 1e-3, 0.03])),
    )  # fmt: skip


def any_profile(rng: np.random.Generator) -> Profile:
    """Draw the paper's profile or ours, other parts in place of some of its own, and each parameter of each part."""
    usual, base = USUAL[rng.integers(len(USUAL))], profile(BASES[rng.integers(len(BASES))])
    others = {
        "perception": (None,), "slow": (None,), "null_space": (None,), "approach": (ApproachRestriction(), None),
        "detect": (MovingThresholds(),), "react": (DecayingVelocity(),),
    }  # fmt: skip
    drawn = {}
    for name, kinds in others.items():
        rare = rng.random() < (1.0 - usual) * (0.25 if name == "perception" else 0.6)
        drawn[name] = kinds[rng.integers(len(kinds))] if rare else getattr(base, name)
    parts = {item.name: drawn.get(item.name, getattr(base, item.name)) for item in fields(base)}
    varied = {name: _varied(rng, part, usual) if is_dataclass(part) else part for name, part in parts.items()}
    return Profile(**{**varied, "name": "fuzzed"})


def _varied(rng: np.random.Generator, part: Checked, usual: float) -> Checked:
    """Draw each parameter of a part: the usual value, or one far off that its checks allow."""
    for name, hint in hints_of(type(part)).items():
        value = SOON.get(name, getattr(part, name))
        value = _varied(rng, value, usual) if isinstance(value, Checked) else value
        choices = [value, *(ONLY.get(name) or _far(rng, hint, value, usual))]
        order = rng.permutation(len(choices)) if rng.random() > usual else [0]
        for i in (*order, 0):
            with suppress(ParameterError):
                part = replace(part, **{name: choices[i]})
                break
    return part


def _far(rng: np.random.Generator, hint: object, value: object, usual: float) -> Iterator[object]:
    """What else a parameter may be: what a check bounds, up to the bound."""
    for kind in get_args(hint) if get_origin(hint) is UnionType else (hint,):
        if kind is NoneType:
            yield None
        elif kind is bool:
            yield not value
        elif get_origin(kind) is Literal:
            yield from get_args(kind)
        elif isinstance(kind, type) and issubclass(kind, Checked):
            yield _varied(rng, kind(), usual)
        for check in getattr(kind, "__metadata__", ()):
            number = kind.__origin__
            yield from (number(end) for end in (check.low, check.high) if np.isfinite(end))
            yield from (number(times * value) for times in (FAR, 1 / FAR) if value is not None)


def any_skin(rng: np.random.Generator, model: RobotModel) -> Skin:
    """Draw the paper's skin where it fits, or 0, 1, 7 or 32 units on the surface of the arm.

    They look outwards, anywhere, or inwards: then a reading may put its point on the axis of the unit's own link. In
    half of these skins the places of the units are uncertain, slightly or as much as a skin may say.
    """
    if rng.random() < 0.3 and model.description.name == "panda":
        return paper_skin(model)
    count = int(rng.choice([0, 1, 7, 7, 32]))
    worst = np.array([(0.0, 0.0), (0.0, 0.0), (0.01, 0.05), (0.5, 1.5)])[rng.integers(4)]
    units = []
    for unit in spread(model, count, int(rng.integers(1 << 31))).units:
        T, (p, o) = unit.T_link_sensor.copy(), worst * rng.random(2)
        looks = {0: np.eye(3), 1: Rotation.random(rng=rng).as_matrix(), 2: np.diag([1.0, -1.0, -1.0])}
        T[:3, :3] = T[:3, :3] @ looks[int(rng.choice([0, 0, 1, 2]))]
        units.append(replace(unit, T_link_sensor=T, position_sigma=p, orientation_sigma=o))
    return Skin(units, model)


def any_fixtures(rng: np.random.Generator) -> Fixtures:
    """Draw nothing, a floor, or a floor, a wall, a pole and a ball, one of them where the arm is."""
    kind = rng.integers(3)
    if kind == 0:
        return no_fixtures()
    planes = np.array([[0.0, 0.0, 1.0, -0.2], [0.0, 1.0, 0.0, rng.uniform(-1.0, 0.5)]])[:kind]
    a = rng.uniform(-0.8, 0.8, (2, 3))
    b = a + np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    pole_and_ball = Capsules(np.zeros(2, np.int64), a, b, np.array([0.03, 0.3]))
    return Fixtures(planes, pole_and_ball if kind == 2 else no_fixtures().capsules)


def any_start(rng: np.random.Generator, model: RobotModel, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Draw joint positions and velocities: ready, anywhere, at limits, beyond them, stretched, folded."""
    low, high = model.q_min + margin, model.q_max - margin
    q = model.description.q_ready.copy()
    kind = rng.integers(6)
    if kind == 1:
        q = rng.uniform(low, high)
    elif kind == 2:
        q = np.where(rng.random(7) < 0.5, low, high)
    elif kind == 3:
        j = rng.integers(7)
        q[j] = rng.choice([low[j] - rng.choice([1e-9, 0.05, 3.0]), high[j] + rng.choice([1e-9, 0.05, 3.0])])
    elif kind == 4:
        q = np.array([0.0, 0.0, 0.0, high[3], 0.0, 0.0, 0.0])
    elif kind == 5:
        q[3] = low[3]
    qd = model.description.qd_max * rng.uniform(-1.0, 1.0, 7) * rng.choice([0.0, 0.0, 0.3, 1.0, 1.6])
    return q, qd


def any_path(rng: np.random.Generator, model: RobotModel, q: np.ndarray) -> Path:
    """Draw a path: the paper's, at the hand, tiny, through many corners, far away, out of reach."""
    x = model.kinematics(q).position[model.ee]
    kind = rng.integers(7)
    if kind == 0:
        return Circle()
    if kind == 1:
        return Circle((x[0], x[1] - 0.25, x[2]))
    if kind == 2:
        return Circle(tuple(x), float(rng.choice([1e-6, 1e-4, 10.0])))
    if kind == 3:
        return WayPoints(x + rng.uniform(-0.4, 0.4, (int(rng.integers(2, 9)), 3)), closed=bool(rng.random() < 0.5))
    if kind == 4:
        return WayPoints(x + np.array([[0, 0, 0], [2e-6, 0, 0], [0, 2e-6, 0]]), closed=bool(rng.random() < 0.5))
    ends = rng.uniform(-1.0, 1.0, 3) * rng.choice([1.0, 3.0, 900.0])
    return segment(tuple(x), tuple(ends)) if kind == 5 else segment((0.0, 0.0, 0.3), tuple(ends + 2.0))
