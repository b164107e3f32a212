"""Filters between a commander and the arm, compared by limits that hold for any command, and by their interventions."""

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
from pretouch.sim.plant import Plant
from pretouch.text_table import TextTable
from pretouch.types import BoolArray, ControlStep, FloatArray
from pretouch_lab.bench.avoidance_scenes import Setting, scenarios, setting
from pretouch_lab.bench.obstacle import least_distance, nearest
from pretouch_lab.bench.scenes import SeedRange
from pretouch_lab.encounters import encounters, nearest_of
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, grouped, rounded, table
from pretouch_lab.trial import Record, play

FILTERS: dict[str, Profile] = {
    "pretouch": profile("pretouch"),
    "paper": profile("paper"),
    "none": profile("pretouch:approach=none:null_space=none"),
}
"""`none` senses and reacts to contacts like `pretouch`, but limits only the joints."""
SCENES = ("walking", "srdo", "drdo", "inside")
"""Scenarios of `bench avoidance` with motion: a person walks up, an obstacle passes over a standing arm or into the
path of a moving one, a hand is put into the path and withdrawn."""
SEEN_S = 0.4
"""Time before a contact in which the touching part must be in view [s]: latency and the time in which a row tightens
from the fastest approach on the braking curve (0.06 s + 0.8 / 3 s), and two readings."""
SAME_M = 0.1
"""Largest distance of a sensed point's closest point from the touching place of the arm [m]."""
TOLERANCE = 1e-9
"""Rounding error that a joint may exceed a limit by: position [rad], velocity [rad/s], acceleration [rad/s, in a
period]."""
_AFTER_S = 1.5
"""Time from the first touch to the end of a trial [s]."""
_TRIALS = {"pretouch": (50, 100), "paper": (6, 14), "none": (6, 14)}
"""Numbers of trials of a scene, with the commanders `tracking` and `at-person`."""
_DRIVE_1_S = 50.0


def speed_bound(mistaken: float) -> float:
    """Bound on the normal speed of a touching point [m/s] whose distance was overestimated by `mistaken` [m].

    It is the braking curve of the profile `pretouch` at that distance, the touch speed without a mistake, and the error
    of the drives. A critically damped impedance of w = 50 rad/s (3000 Nm/rad, 1.2 kg m^2) follows a step a of the
    acceleration with a velocity error of up to a / (e w). Here a is the sum of the rates at which a row may loosen and
    tighten.
    """
    p = BrakingParams()
    cap = braking_cap(mistaken, p.touch_speed_m_s, p.deceleration_m_s2, p.latency_s, p.margin_m)
    return float(cap + (p.loosen_m_s2 + p.tighten_m_s2) / (np.e * _DRIVE_1_S))


Commander = Callable[[float, Kinematics, FloatArray], Desired]
"""Returns a desired motion at a time [s] from the arm's true posture and the person's position (3,) [m]."""


class AtPerson:
    """A commander that drives a part of the arm at the person: the hand, the nearest part, or one of the capsules."""

    def __init__(self, scene: Setting, seed: int) -> None:
        """Draw a kind, a part and a speed of 0.2 to 1.5 m/s."""
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
        # damped, so that singularities need no infinite joint velocities
        return joint_velocities(now, J.T @ np.linalg.solve(J @ J.T + 0.05**2 * np.eye(3), self._speed * near.direction))


class Tracking:
    """An ordinary commander: resolved rate along a path at 0.2 m/s by the clock, without regard to people."""

    def __init__(self, scene: Setting) -> None:
        """Take the path of a scene."""
        self._path, self._model = scene.setup.path, scene.setup.model

    def goal(self, now: float) -> FloatArray:
        """Return the position (3,) [m] on the path at a time."""
        way = 0.2 * now
        return self._path.point(way if self._path.closed else min(way, self._path.length))

    def __call__(self, now: float, kin: Kinematics, person: FloatArray) -> Desired:
        """See `Commander`."""
        ahead = (self.goal(now + 0.01) - self.goal(now)) / 0.01
        velocity = ahead + 2.0 * (self.goal(now) - kin.position[self._model.ee])
        return twist(now, velocity * min(1.0, 0.5 / max(float(np.linalg.norm(velocity)), 1e-9)))


def plays(seeds: SeedRange, quick: bool) -> list[Play]:
    """Return all trials: each filter and commander in each scene, with one seed in a quick run."""
    return [
        ({"filter": name, "commander": commander, "scene": scene}, seed)
        for name in FILTERS
        for commander, count in zip(("tracking", "at-person"), _TRIALS[name], strict=True)
        for scene in SCENES
        for seed in scenarios()[scene].first_seeds(seeds, 1 if quick else count)
    ]


def trial(cell: Cell, seed: int) -> Row:
    """Play a trial, and measure its touches, its violations of limits, and the change by the filter."""
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
    """Return the velocity (3,) of the end-effector's origin that a commander desires [m/s]."""
    first = desired.number[0]
    return first[:3] if desired.kind is DesiredKind.TWIST else np.asarray(model.ee_jacobian(kin)[:3] @ first)


def breaks_limits(q: FloatArray, before: FloatArray, command: FloatArray, limits: JointLimits) -> BoolArray:
    """Return flags (S,) of the commands that violate a limit of a joint or are NaN.

    Args:
        q: (S, n) commanded positions at the end of each step [rad].
        before: (S, n) previous commands [rad/s].
        command: (S, n) commands [rad/s].
        limits: those of the controller, with its margin at the ends of the joints.
    """
    slow = np.abs(command) <= limits.qd_max + TOLERANCE
    smooth = np.abs(command - before) <= limits.qdd_max * limits.period + TOLERANCE
    inside = (q >= limits.q_min - TOLERANCE) & (q <= limits.q_max + TOLERANCE)
    return np.asarray(~(slow & smooth & inside).all(axis=1))


def touches_of(record: Record, scene: Setting) -> list[Row]:
    """Return the separate touches of a trial, each with the speed of the arm and the error of the sensed distance.

    That speed is the part that a controller determines.
    """
    return [
        {"speed_m_s": each.arm_m_s, "mistaken_m": _mistaken(record, scene, each.step, each.link)}
        for each in encounters(record, scene.setup.model, scene.shape)
    ]


def _mistaken(record: Record, scene: Setting, at: int, link: int) -> float | None:
    """Return the largest overestimate of the touching part's distance [m]; None if it was not seen in time.

    It was seen in time if each step of the last `SEEN_S` has an obstacle whose closest point of the body is on the
    touching body, within `SAME_M` of the truly nearest place.
    """
    rigid, worst = scene.setup.model.rigid, -np.inf
    first = int(np.searchsorted(record.times(), record.steps[at].stamp - SEEN_S))
    for i in range(first, at + 1):
        near, o = nearest_of(record, scene.setup.model, scene.shape, i, link), record.steps[i].obstacles
        same = rigid[o.link] == rigid[link]
        same &= np.linalg.norm(o.body_point - near.point, axis=1) < SAME_M
        if not same.any():
            return None
        worst = max(worst, float(o.body_distance[same].min()) - near.distance)
    return rounded(worst, 4)


def results(rows: Iterable[Row]) -> list[Row]:
    """Return a row for each filter and commander, with touches seen in time and others separate."""
    groups = []
    for key, trials in grouped(rows, ("filter", "commander")):
        steps = sum(trial["steps"] for trial in trials)
        touches = [touch for trial in trials for touch in trial["touches"]]
        visible = [touch for touch in touches if touch["mistaken_m"] is not None]
        excess = [touch["speed_m_s"] - speed_bound(touch["mistaken_m"]) for touch in visible]
        kinds = {"": visible, "unseen_": [touch for touch in touches if touch["mistaken_m"] is None]}
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
        "Limits broken: steps that exceed a limit of position, velocity or acceleration by more than"
        f" {TOLERANCE:g}, or are NaN. seen: in each step of the {SEEN_S:g} s before the touch the controller had a"
        f" point whose closest point on the body was within {100 * SAME_M:.0f} cm of the touching place. The bound is"
        " the speed on the braking curve at the overestimate of the distance, plus the error of the drives:"
        f" {speed_bound(0.01):.2f} m/s at 1 cm, {speed_bound(0.02):.2f} at 2 cm, {speed_bound(0.05):.2f} at 5 cm."
        " unseen: no filter can prevent these touches. least: least true distance. off: rms distance of the hand from"
        " the goal of the ordinary commander. change: rms difference of the end-effector's velocities before and after"
        " the filter."
    )
    return [table("Filters: limits that hold for any command, and interventions", _COLUMNS, groups, note, 2)]
