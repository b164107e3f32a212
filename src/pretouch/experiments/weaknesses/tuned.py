"""Whether restrictions "can be tuned to avoid completely": a static object on the path, and a hand that comes near."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from pretouch.control.path import Path, line
from pretouch.experiments import static
from pretouch.experiments.cell import Cell, Context, Grid
from pretouch.experiments.experiment import Experiment, Picture, Sources
from pretouch.experiments.groups import cells_of, grouped
from pretouch.experiments.metrics import mean_over, peak, rounded
from pretouch.experiments.pushes import PALM, Push, Pusher, way_round
from pretouch.experiments.static import least_sensed
from pretouch.experiments.tables import TextTable, number
from pretouch.experiments.trial import Record, Setup, play
from pretouch.params import RestrictionMode, profile
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import HandGoal, HandScript, point_on_arm
from pretouch.sim.plant import Plant
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import ControlStep, FloatArray

NAME = "tuned"
V_MAX_M_S = (0.04, 0.1, 0.2, 0.4)
SLACK_WEIGHTS = (1, 1000)
SCENES = ("circle", "line", "reach", "follow")
"""The static object on circle and line; a hand that reaches for where the arm stands; one that follows the arm."""

_STATIC_S, _HAND_S = 25.0, 11.0
_AFTER_TOUCH_S = 0.5
_STIFFNESS_N_PER_M = 25_000.0
_REST_M_S = 0.005
_SMOOTH_STEPS = 50
"""Half a second of control steps, over which the end-effector's velocity is averaged."""

_LOOK_BACK_STEPS = 3
"""Control steps over which the speed of the person's hand before a touch is taken."""

_STANDS_M = (0.5, 0.0, 0.4)
"""Where the arm stands by [m]."""
_STARTS_S = 4.5
_FORCE_N = 10.0
"""Force with which the hand comes at most: it means to touch, not to push [N]."""
_TILT = 0.1
"""The hand leaves the axis of the unit it comes along by up to this in each component."""
_STAND_OFF_M, _SPEED_M_S, _FREE_N = 0.5, 0.35, 60.0
"""Where the hand sets off [m], how fast it comes [m/s], and the force a free hand is moved with [N]."""


def cells(grid: Grid) -> list[Cell]:
    """A cell for each scene and each tuning of each profile with proximity: slack at all values, hard and off."""
    sensing = [name for name in grid.profiles if profile(name).perception.enabled]
    tunings: list[tuple[str, RestrictionMode]] = []
    for name in sensing:
        values = product(SLACK_WEIGHTS, V_MAX_M_S)
        tunings += [(_tuned(name, v_max, weight), "slack") for weight, v_max in values]
        tunings += [(name, "hard"), (name, "off")]
    return [
        Cell(NAME, name, {"scene": where, "restrictions": mode}) for where, (name, mode) in product(SCENES, tunings)
    ]


def _tuned(name: str, v_max: float, weight: int) -> str:
    return f"{name}:restriction.v_max_m_s={v_max:g}:restriction.slack_weight={weight}"


def trial(cell: Cell, seed: int, context: Context) -> tuple[dict[str, Any], Record]:
    """Run one trial; return its row of results and what it left behind."""
    where = str(cell.where["scene"])
    still = where in static.TRAJECTORIES
    side = static.SIDES[seed % 2]
    setup = Setup(
        model=context.model,
        skin=context.skin,
        profile=context.profile(cell),
        scene=static.scene(where, side, _STIFFNESS_N_PER_M, seed) if still else SceneSpec(hand=HandSpec()),
        path=static.path(where, side) if still else standing(),
        seed=seed,
        hand=None if still else person(where, seed, context.model),
    )
    record = play(setup, _done(_STATIC_S if still else _HAND_S))
    tuning = setup.profile.restriction
    row = {
        "experiment": NAME,
        **cell.where,
        "profile": cell.profile,
        "seed": seed,
        "v_max_m_s": tuning.v_max_m_s,
        "slack_weight": tuning.slack_weight,
        **results(record, still),
    }
    return row, record


def standing() -> Path:
    """Return a path of two centimetres, at whose end the arm stands by."""
    x, y, z = _STANDS_M
    return line((x, y + 0.02, z), _STANDS_M)


def person(where: str, seed: int, model: RobotModel) -> HandScript:
    """Return a person whose hand comes at the standing arm along one of its side units.

    The visitor of the avoidance experiment does not come near an arm that stands in its place, and is met where no unit
    looks. So here one hand goes to where the arm stood and no farther, whether it gives way or not; the other goes on
    until it touches, as the pushes do.
    """
    rng = np.random.default_rng([seed, 44])
    inwards = np.array([0.0, 1.0 if seed % 2 else -1.0, 0.0]) + _TILT * rng.uniform(-1, 1, 3)
    touch = Push(_STARTS_S + rng.uniform(0, 0.5), inwards / np.linalg.norm(inwards), _FORCE_N, 0.2)
    return Reach(model, touch) if where == "reach" else Pusher(model, (touch,))


@dataclass
class Reach:
    """Reaches for the place where the robot's hand stands when the hand sets off, and stays there."""

    model: RobotModel
    touch: Push
    _aim: FloatArray = field(default_factory=lambda: np.zeros(3))
    _direction: FloatArray = field(default_factory=lambda: np.zeros(3))

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Wait before a side of the robot's hand, then come straight."""
        if time < self.touch.start:
            link = self.model.link_index("panda_hand")
            self._aim = point_on_arm(plant, link, PALM)
            self._direction = point_on_arm(plant, link, PALM + self.touch.inwards) - self._aim
            return HandGoal(way_round(hand, self._aim - _STAND_OFF_M * self._direction), _FREE_N)
        ahead = min(0.0, _SPEED_M_S * (time - self.touch.start) - _STAND_OFF_M)
        return HandGoal(self._aim + ahead * self._direction, self.touch.force)


def _done(limit: float) -> Callable[[ControlStep, Plant], bool]:
    """End a moment after the first touch, or at the time limit."""

    def done(step: ControlStep, plant: Plant) -> bool:
        touched = bool(plant.touches) and step.stamp >= plant.touches[0].time + _AFTER_TOUCH_S
        return touched or step.stamp >= limit

    return done


def results(record: Record, still: bool) -> dict[str, Any]:
    """Numbers of one trial; `still`: the object is static, so that the arm has to come to rest by itself."""
    true, touch = np.linalg.norm(record.true_force, axis=1), record.first_contact()
    speed = smooth_speed(record)
    rest = rest_time(record.times(), speed) if still and touch is None else None
    until = np.inf if touch is None else touch
    ready = [s.ee_position for s in record.steps if _STARTS_S - 1.0 <= s.stamp <= until]
    away = max((float(np.linalg.norm(x - ready[0])) for x in ready), default=0.0)
    return {
        "contact": touch is not None,
        "impact_speed_m_s": rounded(closing_speed(record, still), 4) if touch else None,
        "true_peak_20ms_n": rounded(peak(mean_over(true, 20))) if touch else None,
        "least_sensed_m": least_sensed(record),
        "rest_s": None if rest is None else rounded(rest),
        "speed_left_m_s": rounded(speed[-1], 4) if still and touch is None else None,
        "gave_way_m": None if still else rounded(away, 4),
        "held": record.held(),
    }


def closing_speed(record: Record, still: bool) -> float:
    """Speed [m/s] of the point of the arm that touches first relative to what it touches, just before."""
    first = record.touches[0]
    if still:
        return float(np.linalg.norm(first.velocity))
    before = int(np.searchsorted(record.times(), first.time)) - 1
    start = before - _LOOK_BACK_STEPS
    span = record.steps[before].stamp - record.steps[start].stamp
    hand = (record.hand_position[before] - record.hand_position[start]) / span
    return float(np.linalg.norm(first.velocity - hand))


def smooth_speed(record: Record) -> FloatArray:
    """Speed (S,) [m/s] of the end-effector from its mean velocity over half a second: noise is no motion."""
    velocity = np.array([s.ee_velocity for s in record.steps])
    before = np.vstack([np.zeros((_SMOOTH_STEPS - 1, 3)), velocity])
    means = np.array([mean_over(axis, _SMOOTH_STEPS) for axis in before.T])
    return np.linalg.norm(means, axis=0)


def rest_time(times: FloatArray, speed: FloatArray) -> float | None:
    """Instant [s] from which an arm that once moved stays below 5 mm/s to the end, or None."""
    moving = np.flatnonzero(speed >= _REST_M_S)
    if len(moving) == 0 or moving[-1] + 1 >= len(speed):
        return None
    return float(times[moving[-1] + 1])


_BY = ("scene", "profile", "restrictions", "v_max_m_s", "slack_weight")
_MEASURES = (
    "impact_speed_m_s", "true_peak_20ms_n", "least_sensed_m", "rest_s", "speed_left_m_s", "gave_way_m",
)  # fmt: skip


def summarise(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Cells of the experiment."""
    return {"cells": cells_of(rows, _BY, _MEASURES, ("contact",), ("held",))}


def tables(part: dict[str, Any]) -> list[TextTable]:
    """One table for the static object, one for the hand that comes."""
    still = [cell for cell in part["cells"] if cell["scene"] in static.TRAJECTORIES]
    moving = [cell for cell in part["cells"] if cell["scene"] not in static.TRAJECTORIES]
    return [table for table, cells in ((_still(still), still), (_moving(moving), moving)) if cells]


_HEADER = ("scene", "mode", "V_max\n[m/s]", "weight", "n", "hit\n[%]", "impact\n[m/s]", "true\n[N]", "least\n[m]")


def _common(cell: dict[str, Any]) -> tuple[str, ...]:
    off, soft = cell["restrictions"] == "off", cell["restrictions"] in ("slack", "floor")
    return (
        cell["scene"],
        cell["restrictions"],
        "-" if off else f"{cell['v_max_m_s']:g}",
        f"{cell['slack_weight']:g}" if soft else "-",
        str(cell["trials"]),
        f"{100 * cell['contact_fraction']:.0f}",
        number(cell["impact_speed_m_s"], 3),
        number(cell["true_peak_20ms_n"], 0),
        number(cell["least_sensed_m"], 3),
    )


def _still(cells: list[dict[str, Any]]) -> TextTable:
    return TextTable(
        "Restrictions tuned: a static object on the path, 25 N/mm, medians",
        (*_HEADER, "rest\n[s]", "left\n[m/s]"),
        tuple((*_common(cell), number(cell["rest_s"], 1), number(cell["speed_left_m_s"], 3)) for cell in cells),
        "Weight: of a row's squared violation against the squared task error. Hit: trials with contact in 25 s. Impact:"
        " closing speed at the touch. True: peak of the true force, 20 ms mean. Least: nearest that the units showed"
        " something to the arm's surface; they show none nearer than 4 cm. Rest: when the arm is below 5 mm/s for good."
        " Left: speed after 25 s without contact.",
    )


def _moving(cells: list[dict[str, Any]]) -> TextTable:
    return TextTable(
        "Restrictions tuned: a hand comes at the standing arm with 0.35 m/s, medians",
        (*_HEADER, "away\n[m]"),
        tuple((*_common(cell), number(cell["gave_way_m"], 3)) for cell in cells),
        "Reach: the hand goes to where the robot's hand stood, and no farther. Follow: it goes on until it touches. It"
        " comes along the beam of a unit, with 10 N at most. Away: how far the end-effector moved from its"
        " place, up to the touch if there is one. Other columns as above.",
    )


_STYLES = {1.0: ("--", "s"), 1000.0: ("-", "o")}


def _draw(sources: Sources) -> list[Picture]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True)
    slack = [cell for cell in sources.summary["cells"] if cell["restrictions"] == "slack"]
    for key, group in grouped(slack, ("scene", "slack_weight")):
        ls, marker = _STYLES.get(key["slack_weight"], (":", "^"))
        first = key["scene"] in ("circle", "reach")
        colour, size = ("black", 9) if first else ("tab:gray", 5)
        still = key["scene"] in static.TRAJECTORIES
        values = [
            100 * cell["contact_fraction"] if still else (cell["impact_speed_m_s"] or {}).get("median", np.nan)
            for cell in group
        ]
        (left if still else right).plot(
            [cell["v_max_m_s"] for cell in group], values, ls=ls, marker=marker, ms=size, color=colour,
            label=f"{key['scene']}, weight {key['slack_weight']:g}",
        )  # fmt: skip
    left.set(title="A static object on the path", ylabel="trials with contact [%]", ylim=(-5, 105))
    right.set(title="A hand comes at the standing arm", ylabel="closing speed at the touch [m/s]", ylim=(0, 0.4))
    for axes in (left, right):
        axes.set_xlabel("V_max [m/s]")
        axes.grid(alpha=0.3)
        if axes.lines:
            axes.legend()
    return [Picture("tuned", "Contact with a static object and with a hand by V_max and weight", figure)]


def _cost(cell: Cell) -> float:
    if cell.where["scene"] not in static.TRAJECTORIES:
        return 6.5
    return 7.0 if cell.where["restrictions"] == "off" else _STATIC_S


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables, _draw)
