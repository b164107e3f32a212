"""Whether restrictions "can be tuned to avoid completely": a static object on the path, and a hand that comes near."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from textwrap import fill

import numpy as np

from pretouch.control.approach_restriction import of_table_i
from pretouch.control.path import Path, line
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import HandGoal, HandScript, point_on_arm
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant
from pretouch.sim.pushes import PALM, Push, way_round
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import Column, TextTable, tabulated
from pretouch.traces import mean_over
from pretouch.types import ControlStep, FloatArray
from pretouch_lab.cell import NAMES_MODE, Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.paper import static
from pretouch_lab.paper.static import least_sensed
from pretouch_lab.restrictions import mode_of
from pretouch_lab.rows import Row, cells_of, grouped, peak, rounded
from pretouch_lab.tables import median, plain
from pretouch_lab.trial import Record, play

NAME = "tuned"
V_MAX_M_S = (0.04, 0.1, 0.2, 0.4)
SLACK_WEIGHTS = (1.0, 1000.0)
SCENES = ("circle", "line", "reach")
"""The static object on circle and line; a hand that reaches for where the arm stands."""

_STATIC_S, _HAND_S = 25.0, 11.0
_AFTER_TOUCH_S = 0.5
_STIFFNESS_N_PER_M = 25_000.0
_WINDOW_S = 2.0
"""Time over which the end-effector's displacement is taken for its speed [s]: the noise of a velocity is no motion."""
_REST_M_S = 0.002
"""Below this the arm is at rest [m/s]: the jitter of an arm that stands comes to 0.1 mm/s or less over the window."""

_LOOK_BACK_STEPS = 3
"""Control steps over which the speed of the person's hand before a touch is taken."""
_WAY_M = 0.01
"""Last piece of its way that shows where the hand comes from [m]; a hand that stands has come from there before."""

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
    """A cell for each scene and each tuning of each profile with proximity: slack at all values, hard and off.

    A profile that is named with a mode is taken as it is, once.
    """
    tunings: list[tuple[str, str]] = []
    for name in grid.profiles:
        found = profile(name)
        if found.perception is None:
            continue
        if NAMES_MODE.search(name):
            tunings.append((name, mode_of(found)))
            continue
        values = product(SLACK_WEIGHTS, V_MAX_M_S)
        tunings += [(name + _tuning(v_max, weight), "slack") for weight, v_max in values]
        tunings += [(name, "hard"), (name, "off")]
    return [
        Cell(NAME, name, {"scene": where, "restrictions": mode})
        for where, (name, mode) in product(SCENES, dict.fromkeys(tunings))
    ]


def _tuning(v_max: float, weight: float) -> str:
    return f":approach.v_max_m_s={v_max:g}:approach.slack_weight={weight:g}"


def base(cell: Row) -> str:
    """Return the name of the profile that a cell tunes."""
    name = str(cell["profile"])
    tuned = cell["restrictions"] == "slack"
    return name.removesuffix(_tuning(cell["v_max_m_s"], cell["slack_weight"])) if tuned else name


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    where = str(cell.where["scene"])
    still = where in static.TRAJECTORIES
    side = static.SIDES[seed % 2]
    setup = context.setup(
        cell,
        seed,
        static_scene(where, side, _STIFFNESS_N_PER_M, seed) if still else SceneSpec(hand=HandSpec()),
        static_path(where, side) if still else standing(),
        hand=None if still else person(seed, context.model),
    )
    record = play(setup, _done(_STATIC_S if still else _HAND_S))
    tuning = of_table_i(setup.profile.approach)
    row = {
        **cell.row(seed),
        "v_max_m_s": tuning.v_max_m_s,
        "slack_weight": tuning.slack_weight,
        **results(record, still),
    }
    return row, record


def standing() -> Path:
    """Return a path of two centimetres, at whose end the arm stands by."""
    x, y, z = _STANDS_M
    return line((x, y + 0.02, z), _STANDS_M)


def person(seed: int, model: RobotModel) -> HandScript:
    """Return a person whose hand comes at the standing arm along one of its side units.

    The visitor of the avoidance experiment does not come near an arm that stands in its place, and is met where no unit
    looks. So here the hand goes to where the arm stood and no farther, whether it gives way or not. A hand that went on
    until it touched would touch in any case, and as fast as it chose to follow.
    """
    rng = np.random.default_rng([seed, 44])
    inwards = np.array([0.0, 1.0 if seed % 2 else -1.0, 0.0]) + _TILT * rng.uniform(-1, 1, 3)
    touch = Push(_STARTS_S + rng.uniform(0, 0.5), inwards / np.linalg.norm(inwards), _FORCE_N, 0.2)
    return Reach(model, touch)


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


def results(record: Record, still: bool) -> Row:
    """Numbers of one trial; `still`: the object is static, so that the arm has to come to rest by itself."""
    true, touch = np.linalg.norm(record.true_force, axis=1), record.first_contact()
    times, speed = displacement_speed(record)
    stopping = still and touch is None
    rest = rest_time(times, speed) if stopping else None
    until = np.inf if touch is None else touch
    ready = [s.ee_position for s in record.steps if _STARTS_S - 1.0 <= s.stamp <= until]
    away = max((float(np.linalg.norm(x - ready[0])) for x in ready), default=0.0)
    return {
        "contact": touch is not None,
        "impact_speed_m_s": rounded(closing_speed(record, still), 4) if touch else None,
        "true_peak_20ms_n": rounded(peak(mean_over(true, 20))) if touch else None,
        "least_sensed_m": least_sensed(record),
        "rest_s": None if rest is None else rounded(rest),
        "speed_left_m_s": rounded(speed[-1], 4) if stopping and len(speed) else None,
        "gave_way_m": None if still else rounded(away, 4),
        "held": record.held(),
    }


def closing_speed(record: Record, still: bool) -> float:
    """Closing speed [m/s] of the point of the arm that touches first and what it touches, just before.

    With the static object: across its face. With the hand: along the hand's own way, so that sliding past is left out.
    """
    first = record.touches[0]
    if still:
        return abs(float(first.velocity[1]))
    before = int(np.searchsorted(record.times(), first.time)) - 1
    start = before - _LOOK_BACK_STEPS
    span = record.steps[before].stamp - record.steps[start].stamp
    hand = (record.hand_position[before] - record.hand_position[start]) / span
    ways = record.hand_position[before] - record.hand_position[:before]
    sizes = np.linalg.norm(ways, axis=1)
    last = np.flatnonzero(sizes >= _WAY_M)[-1]
    return float((hand - first.velocity) @ ways[last] / sizes[last])


def displacement_speed(record: Record) -> tuple[FloatArray, FloatArray]:
    """Instants (T,) [s] and the end-effector's speed (T,) [m/s] over the 2 s after each.

    The speed is the displacement over the 2 s, divided by them. The last instant is 2 s before the record's end.
    """
    times, position = record.times(), np.array([s.ee_position for s in record.steps])
    end = np.searchsorted(times, times + _WINDOW_S - 1e-9)
    start = np.flatnonzero(end < len(times))
    way = np.linalg.norm(position[end[start]] - position[start], axis=1)
    return times[start], way / _WINDOW_S


def rest_time(times: FloatArray, speed: FloatArray) -> float | None:
    """Instant [s] from which an arm that once moved stays below 2 mm/s to the end, or None."""
    moving = np.flatnonzero(speed >= _REST_M_S)
    if len(moving) == 0 or moving[-1] + 1 >= len(speed):
        return None
    return float(times[moving[-1] + 1])


_BY = ("scene", "profile", "restrictions", "v_max_m_s", "slack_weight")
_MEASURES = (
    "impact_speed_m_s", "true_peak_20ms_n", "least_sensed_m", "rest_s", "speed_left_m_s", "gave_way_m",
)  # fmt: skip


def summarise(rows: list[Row]) -> Row:
    """Cells of the experiment."""
    return {"cells": cells_of(rows, _BY, _MEASURES, ("contact",), ("held",))}


def tables(part: Row) -> list[TextTable]:
    """One table for the static object, one for the hand that comes."""
    still = [cell for cell in part["cells"] if cell["scene"] in static.TRAJECTORIES]
    moving = [cell for cell in part["cells"] if cell["scene"] not in static.TRAJECTORIES]
    many = len({base(cell) for cell in part["cells"]}) > 1
    return [table(cells, many) for table, cells in ((_still, still), (_moving, moving)) if cells]


_NAME_WIDTH = 24
"""Characters of the first column at most: the table keeps to 80."""


def _common(many: bool) -> tuple[Column, ...]:
    def scene(cell: Row) -> str:
        return f"{cell['scene']}\n{fill(base(cell).replace(':', ' '), _NAME_WIDTH)}" if many else str(cell["scene"])

    def weight(cell: Row) -> str:
        return f"{cell['slack_weight']:g}" if cell["restrictions"] in ("slack", "floor") else "-"

    return (
        ("scene", scene),
        ("mode", plain("restrictions")),
        ("V_max\n[m/s]", lambda cell: "-" if cell["restrictions"] == "off" else f"{cell['v_max_m_s']:g}"),
        ("weight", weight),
        ("n", plain("trials")),
        ("hit\n[%]", plain("contact_fraction", ".0f", 100)),
        ("impact\n[m/s]", median("impact_speed_m_s", 3)),
        ("true\n[N]", median("true_peak_20ms_n", 0)),
        ("least\n[m]", median("least_sensed_m", 3)),
    )


def _still(cells: list[Row], many: bool) -> TextTable:
    return tabulated(
        "Restrictions tuned: a static object on the path, 25 N/mm, medians",
        (*_common(many), ("rest\n[s]", median("rest_s", 1)), ("left\n[mm/s]", median("speed_left_m_s", 2, 1000))),
        cells,
        "Weight: of a row's squared violation against the squared task error. Hit: trials with contact in 25 s. Impact:"
        " closing speed at the touch, across the object's face. True: peak of the true force, 20 ms mean. Least:"
        " nearest that the units showed something to the arm's surface; they show none nearer than 4 cm. Without"
        " contact the end-effector's speed is its displacement over 2 s. Rest: when that falls below 2 mm/s for good."
        " Left: that of the last 2 s.",
    )


def _moving(cells: list[Row], many: bool) -> TextTable:
    return tabulated(
        "Restrictions tuned: a hand comes at the standing arm with 0.35 m/s, medians",
        (*_common(many), ("away\n[m]", median("gave_way_m", 3))),
        cells,
        "The hand reaches for where the robot's hand stood, and goes no farther. It comes along the beam of a unit,"
        " with 10 N at most. Impact: closing speed at the touch, along the way of the person's hand. Away: how far the"
        " end-effector moved from its place, up to the touch if there is one. Other columns as for a static object.",
    )


_MARKERS = "so^vD<>p"


def _draw(sources: Sources) -> list[Picture]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True)
    slack = [cell | {"base": base(cell)} for cell in sources.summary["cells"] if cell["restrictions"] == "slack"]
    curves = list(dict.fromkeys((cell["base"], cell["slack_weight"]) for cell in slack))
    many = len({name for name, _ in curves}) > 1
    for key, group in grouped(slack, ("scene", "base", "slack_weight")):
        name, weight = key["base"], key["slack_weight"]
        still = key["scene"] in static.TRAJECTORIES
        colour, size = ("tab:gray", 5) if key["scene"] == "line" else ("black", 9)
        values = [
            100 * cell["contact_fraction"] if still else (cell["impact_speed_m_s"] or {}).get("median", np.nan)
            for cell in group
        ]
        (left if still else right).plot(
            [cell["v_max_m_s"] for cell in group], values, ls={1.0: "--", 1000.0: "-"}.get(weight, ":"),
            marker=_MARKERS[curves.index((name, weight)) % len(_MARKERS)], ms=size, color=colour,
            label=f"{key['scene']}, weight {weight:g}" + (f",\n{fill(name, 2 * _NAME_WIDTH)}" if many else ""),
        )  # fmt: skip
    left.set(title="A static object on the path", ylabel="trials with contact [%]", ylim=(-5, 105))
    right.set(title="A hand comes at the standing arm", ylabel="closing speed at the touch [m/s]", ylim=(0, 0.4))
    for axes in (left, right):
        axes.set_xlabel("V_max [m/s]")
        axes.grid(alpha=0.3)
        if axes.lines:
            axes.legend(fontsize="small")
    return [Picture("tuned", "Contact with a static object and with a hand by V_max and weight", figure)]


def _cost(cell: Cell) -> float:
    if cell.where["scene"] not in static.TRAJECTORIES:
        return 6.5
    return 7.0 if cell.where["restrictions"] == "off" else _STATIC_S


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables, _draw)
