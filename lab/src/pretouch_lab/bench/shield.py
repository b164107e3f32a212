"""Filters between a commander and the arm, compared: what holds whoever commands, and what it costs."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import sqrt

import numpy as np

from pretouch.control.braking import braking_cap
from pretouch.control.joint_box import JointLimits, joint_limits
from pretouch.desired import Desired, DesiredKind, joint_velocities, twist
from pretouch.params import BrakingParams
from pretouch.profiles import Profile, profile
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import Hand
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.text_table import TextTable
from pretouch.types import BoolArray, ControlStep, FloatArray
from pretouch_lab.bench.avoidance_scenes import Setting, scenarios, setting
from pretouch_lab.bench.obstacle import Nearest, least_distance, nearest
from pretouch_lab.bench.scenes import SeedRange
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, grouped, rounded, table
from pretouch_lab.trial import Record, play

FILTERS: dict[str, Profile] = {
    "pretouch": profile("pretouch"),
    "paper": profile("paper"),
    "none": profile("pretouch:approach=none:null_space=none"),
}
"""`none` sees what `pretouch` does, answers contacts as it does, and keeps the limits of the joints alone."""
SCENES = ("walking", "srdo", "drdo", "inside")
"""Scenarios of `bench avoidance` in which somebody moves: a person walks up, an obstacle passes over a standing arm or
into the way of a moving one, a hand is held in the way and taken away."""
SEEN_S = 0.4
"""How long the touching part has to have been known to be near [s]: latency and what a row takes, at its rate of
tightening, from the fastest approach that the braking curve leaves at its greatest distance (0.06 s + 0.8 / 3 s), and
two readings."""
SAME_M = 0.1
"""How near to the touching place of the arm a sensed point's closest point has to be [m]."""
TOLERANCE = 1e-9
"""By how much a joint may pass a limit of position [rad], velocity [rad/s] or acceleration [rad/s, in a period] before
that counts: rounding."""
_AFTER_S, _APART_S = 1.5, 0.2
"""A trial ends so long after its first touch; touches so near after the last contact belong to it [s]."""
_TRIALS = {"pretouch": (50, 100), "paper": (6, 14), "none": (6, 14)}
"""Trials of a scene, with the commanders `tracking` and `at-person`."""
_DRIVE_1_S = 50.0


def speed_bound(mistaken: float) -> float:
    """Largest speed of a touching point along the normal, if it was thought so much farther than it was [m/s].

    The braking curve of the profile `pretouch` at that distance, which is the touch speed where nothing was mistaken,
    and what the drives are off by: a critically damped impedance of w = 50 rad/s (3000 Nm/rad, 1.2 kg m^2) answers an
    acceleration that changes by a with a velocity that is off by up to a / (e w), here for what a row may loosen and
    tighten by.
    """
    p = BrakingParams()
    cap = braking_cap(mistaken, p.touch_speed_max_m_s, p.deceleration_m_s2, p.latency_s, p.margin_m)
    return float(cap + (p.loosen_m_s2 + p.tighten_m_s2) / (np.e * _DRIVE_1_S))


Commander = Callable[[float, Kinematics, FloatArray], Desired]
"""Asks for a motion at a time [s], knowing the arm's true posture and where the person is (3,) [m]."""


class AtPerson:
    """Drives at the person on purpose, at a speed it draws: the hand, what is nearest, or one of the arm's capsules."""

    def __init__(self, scene: Setting, seed: int) -> None:
        """Draw a way, a part and a speed of 0.2 to 1.5 m/s."""
        rng = np.random.default_rng([seed, 31])
        self._way, share, self._speed = int(rng.integers(0, 3)), rng.random(), rng.uniform(0.2, 1.5)
        self._model, self._shape = scene.setup.model, scene.shape
        body = self._model.body
        part = slice(int(share * len(body.radius)), int(share * len(body.radius)) + 1)
        self._body = (
            body if self._way == 1 else Capsules(body.link[part], body.a[part], body.b[part], body.radius[part])
        )

    def __call__(self, now: float, kin: Kinematics, person: FloatArray) -> Desired:
        """See `Commander`."""
        if self._way == 0:
            way = person - kin.position[self._model.ee]
            return twist(now, self._speed * way / max(float(np.linalg.norm(way)), 1e-6))
        near = nearest(kin, self._body, self._shape(person))
        J = self._model.jacobian(kin, near.link, near.point)[:3]
        # damped, so that no singularity asks for more than joints can
        return joint_velocities(now, J.T @ np.linalg.solve(J @ J.T + 0.05**2 * np.eye(3), self._speed * near.direction))


class Tracking:
    """An ordinary commander: resolved rate along a path at 0.2 m/s by the clock, whoever is in the way."""

    def __init__(self, scene: Setting) -> None:
        """Take the path of a scene."""
        self._path, self._model = scene.setup.path, scene.setup.model

    def goal(self, now: float) -> FloatArray:
        """Return where the hand should be at a time (3,) [m]."""
        way = 0.2 * now
        return self._path.point(way if self._path.closed else min(way, self._path.length))

    def __call__(self, now: float, kin: Kinematics, person: FloatArray) -> Desired:
        """See `Commander`."""
        ahead = (self.goal(now + 0.01) - self.goal(now)) / 0.01
        velocity = ahead + 2.0 * (self.goal(now) - kin.position[self._model.ee])
        return twist(now, velocity * min(1.0, 0.5 / max(float(np.linalg.norm(velocity)), 1e-9)))


def plays(seeds: SeedRange, quick: bool) -> list[Play]:
    """Return all trials: each filter and commander in each scene, a quick run with one seed."""
    return [
        ({"filter": name, "commander": commander, "scene": scene}, seed)
        for name in FILTERS
        for commander, count in zip(("tracking", "at-person"), _TRIALS[name], strict=True)
        for scene in SCENES
        for seed in scenarios()[scene].first_seeds(seeds, 1 if quick else count)
    ]


def trial(cell: Cell, seed: int) -> Row:
    """Play a trial, and measure its touches, its limits, and what the filter changed."""
    scene = setting(scenarios()[cell["scene"]], FILTERS[cell["filter"]], seed)
    ordinary = Tracking(scene) if cell["commander"] == "tracking" else None
    commander: Commander = ordinary or AtPerson(scene, seed)
    velocities: list[FloatArray] = []

    def commanding(plant: Plant, hand: Hand | None) -> Callable[[], Desired]:
        if hand is None:
            raise ValueError(f"Nobody is in {cell['scene']}.")

        def ask() -> Desired:
            kin = plant.model.kinematics(plant.read().q)
            desired = commander(plant.time, kin, hand.position)
            velocities.append(asked_velocity(desired, plant.model, kin))
            return desired

        return ask

    def done(step: ControlStep, plant: Plant) -> bool:
        touched = plant.touches and step.stamp > plant.touches[0].time + _AFTER_S
        return scene.done(step, plant) or bool(touched)

    record = play(replace(scene.setup, commander=commanding), done)
    model, task, steps = scene.setup.model, scene.setup.profile.task, record.steps
    q, commanded, command = (np.array([getattr(s, name) for s in steps]) for name in ("q", "q_commanded", "command"))
    before = np.vstack([np.zeros((1, model.n)), command[:-1]])
    broken = breaks_limits(
        commanded, before, command, joint_limits(model, task.position_margin_rad, task.control_period_s)
    )
    moved = [model.ee_jacobian(model.kinematics(at))[:3] @ qd for at, qd in zip(q, command, strict=True)]
    off = [s.ee_position - ordinary.goal(s.stamp) for s in steps] if ordinary else []
    return {
        "touches": touches_of(record, scene),
        "least_distance_m": rounded(least_distance(model, q, scene.shape, record.hand_position), 4),
        "steps": len(steps),
        "limit_violations": int(np.count_nonzero(broken)),
        "change_m2_s2": float(np.nansum((np.array(moved) - velocities) ** 2)),
        "error_m2": float(np.sum(np.square(off))) if ordinary else None,
    }


def asked_velocity(desired: Desired, model: RobotModel, kin: Kinematics) -> FloatArray:
    """Velocity (3,) of the end-effector origin that a commander asks for [m/s]."""
    first = desired.number[0]
    return first[:3] if desired.kind is DesiredKind.TWIST else np.asarray(model.ee_jacobian(kin)[:3] @ first)


def breaks_limits(q: FloatArray, before: FloatArray, command: FloatArray, limits: JointLimits) -> BoolArray:
    """Whether each of S commands breaks a limit of a joint, or is no number.

    Args:
        q: (S, n) commanded positions when it ends [rad].
        before: (S, n) command before it [rad/s].
        command: (S, n) [rad/s].
        limits: those of the controller, its margin at the ends of the joints included.
    """
    slow = np.abs(command) <= limits.qd_max + TOLERANCE
    smooth = np.abs(command - before) <= limits.qdd_max * limits.period + TOLERANCE
    inside = (q >= limits.q_min - TOLERANCE) & (q <= limits.q_max + TOLERANCE)
    return np.asarray(~(slow & smooth & inside).all(axis=1))


def touches_of(record: Record, scene: Setting) -> list[Row]:
    """Return the touches of a trial that are no echo of the one before, each with its speed and whether it was seen.

    The speed is that of the touching point of the arm along the normal to the person, before the contact: what a
    controller can answer for.
    """
    times, rows = record.times(), []
    pressed = record.true_time[np.linalg.norm(record.true_force, axis=1) > TOUCH_N]
    for touch in record.touches:
        earlier = pressed[pressed < touch.time - 1e-9]
        at = int(np.searchsorted(times, touch.time)) - 1
        if at >= 0 and (not len(earlier) or touch.time - earlier[-1] >= _APART_S):
            speed = float(touch.velocity @ _near(record, scene, at, touch.link).direction)
            rows.append({"speed_m_s": rounded(speed, 4), "mistaken_m": _mistaken(record, scene, at, touch.link)})
    return rows


def _mistaken(record: Record, scene: Setting, at: int, link: int) -> float | None:
    """By how much the touching part was thought farther than it was, at most [m]; None where it was not seen in time.

    It was if in each step of the last `SEEN_S` the point of the body nearest to one of the controller's obstacles lay
    on the touching body, within `SAME_M` of the place that is truly nearest.
    """
    rigid, worst = scene.setup.model.rigid, -np.inf
    first = int(np.searchsorted(record.times(), record.steps[at].stamp - SEEN_S))
    for i in range(first, at + 1):
        near, o = _near(record, scene, i, link), record.steps[i].obstacles
        same = rigid[o.link] == rigid[link]
        same &= np.linalg.norm(o.body_point - near.point, axis=1) < SAME_M
        if not same.any():
            return None
        worst = max(worst, float(o.body_distance[same].min()) - near.distance)
    return rounded(worst, 4)


def _near(record: Record, scene: Setting, at: int, link: int) -> Nearest:
    """Closest points of the person and the rigid body of a link at a step."""
    model = scene.setup.model
    body = model.body.of_links(np.flatnonzero(model.rigid == model.rigid[link]))
    return nearest(model.kinematics(record.steps[at].q), body, scene.shape(record.hand_position[at]))


def results(rows: Iterable[Row]) -> list[Row]:
    """Return a row for each filter and commander; touches that were seen in time are apart from the others."""
    groups = []
    for key, trials in grouped(rows, ("filter", "commander")):
        steps = sum(trial["steps"] for trial in trials)
        touches = [touch for trial in trials for touch in trial["touches"]]
        seen = [touch for touch in touches if touch["mistaken_m"] is not None]
        excess = [touch["speed_m_s"] - speed_bound(touch["mistaken_m"]) for touch in seen]
        kinds = {"": seen, "unseen_": [touch for touch in touches if touch["mistaken_m"] is None]}
        row = {
            "trials": len(trials),
            "steps": steps,
            "limit_violations": sum(trial["limit_violations"] for trial in trials),
            "over_bound": sum(each > 0.0 for each in excess),
            "excess_m_s": rounded(max(excess), 4) if excess else None,
            "least_distance_m": min(trial["least_distance_m"] for trial in trials),
            "intervention": _rms([trial["change_m2_s2"] for trial in trials], steps),
            "task_error": _rms([trial["error_m2"] for trial in trials if trial["error_m2"] is not None], steps),
        }
        for kind, some in kinds.items():
            speeds = [touch["speed_m_s"] for touch in some]
            row |= {f"{kind}touches": len(some), f"{kind}touch_speed_m_s": max(speeds, default=None)}
        groups.append(key | row)
    return groups


def _rms(squares: list[float], steps: int) -> float | None:
    return rounded(sqrt(sum(squares) / steps), 4) if squares else None


_COLUMNS = (
    Column("filter", "filter"),
    Column("commander", "commander"),
    Column("trials", "trials"),
    Column("steps", "steps"),
    Column("limits\nbroken", "limit_violations"),
    Column("seen: over\nthe bound", "over_bound", of="touches"),
    Column("by\n[m/s]", "excess_m_s", 2),
    Column("fastest\n[m/s]", "touch_speed_m_s", 2),
    Column("unseen", "unseen_touches"),
    Column("fastest\n[m/s]", "unseen_touch_speed_m_s", 2),
    Column("least\n[mm]", "least_distance_m", 0, 1e3),
    Column("off\n[mm]", "task_error", 0, 1e3),
    Column("change\n[m/s]", "intervention", 2),
)


def tables(groups: list[Row]) -> list[TextTable]:
    """Return the table of `results`."""
    note = (
        f"A limit of position, velocity or acceleration is broken by more than {TOLERANCE:g}, or by no number. seen: in"
        f" each step of the {SEEN_S:g} s before the touch the controller knew a point whose closest point on the body"
        f" lay within {100 * SAME_M:.0f} cm of the touching place. The bound is the speed that the braking curve leaves"
        " where that was thought farther than it was, and what the drives are off by:"
        f" {speed_bound(0.01):.2f} m/s at 1 cm, {speed_bound(0.02):.2f} at 2 cm, {speed_bound(0.05):.2f} at 5 cm."
        " Where nothing was seen no filter can know. least: least true distance. off: rms distance of the hand from"
        " where the ordinary commander wants it. change: rms of how far the command at the end-effector is from what"
        " was asked."
    )
    return [table("What holds whoever commands, and what it costs", _COLUMNS, groups, note, 2)]
