"""Rows that cannot be met: random postures with random points near the body, the QP alone, without a simulation."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pretouch.control.approach_restriction import of_table_i
from pretouch.control.joint_box import joint_box, joint_limits
from pretouch.control.qp import solve, task_cost
from pretouch.control.reduction import speed_scale
from pretouch.control.restriction import ApproachRows, approach_rows
from pretouch.perception.closest import closest_points
from pretouch.profiles import Profile, profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.vectors import placed
from pretouch.text_table import TextTable, tabulated
from pretouch.types import FloatArray, Obstacles, QpOutcome
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, cells_of, grouped, rounded
from pretouch_lab.tables import median, plain

NAME = "infeasible"
_COUNTS = (1, 2, 4, 8)
_POSTURES = 250
_NEAR_M = 0.1
"""Points lie up to this far from the body [m]: where eq. 7 asks for a retreat."""


def cells(grid: Grid) -> list[Cell]:
    """A cell for each number of points and each profile with proximity."""
    sensing = [name for name in grid.profiles if profile(name).perception is not None]
    return [Cell(NAME, name, {"points": float(count)}) for count in _COUNTS for name in sensing]


@dataclass(frozen=True)
class Answers:
    """What the QP makes of one posture with points around it."""

    link: int
    """Link with the closest point of the body to the first of them."""
    fastest_m_s: float
    """Largest retreat from the first that the joints' velocity limits allow."""
    never: bool
    """No joint velocities within their limits meet all rows."""
    at_once: bool
    """None that can be reached from rest in one period meet them."""
    slack_m_s: float
    """Largest violation of a soft row within the velocity limits."""
    slack_at_once_m_s: float
    """The same from rest."""


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, None]:
    """Try a batch of random postures; return the row of results."""
    rng, params = np.random.default_rng([seed, 43]), context.profile(cell)
    count = int(cell.where["points"])
    found = [_posed(context.model, params, count, rng) for _ in range(_POSTURES)]
    row = cell.row(seed)
    return row | results(found, context.model.links), None


def _posed(model: RobotModel, params: Profile, count: int, rng: np.random.Generator) -> Answers:
    """Draw a posture, points near it and a direction of the task, and solve for them."""
    q = rng.uniform(model.q_min, model.q_max)
    kin = model.kinematics(q)
    points = np.array([near_body(model, kin, rng) for _ in range(count)])
    ee = kin.position[model.ee]
    beside = np.tile([0.0, 0.0, 1.0], (count, 1))
    obstacles = closest_points(kin, model.body, ee, np.arange(count), points, beside)
    heading = _unit_vector(rng)
    return answers(model, params, q, obstacles, heading)


def _unit_vector(rng: np.random.Generator) -> FloatArray:
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


def near_body(model: RobotModel, kin: Kinematics, rng: np.random.Generator) -> FloatArray:
    """Draw a point (3,) [m] up to 0.1 m from the moving body, and outside of all of it.

    It lies in a random outward direction from a random point of the surface of a random capsule, so another capsule may
    be nearer to it.
    """
    while True:
        a, b = placed(model.body, kin)
        c = int(rng.integers(len(model.body)))
        surface, normal = _on_surface(a[c], b[c], float(model.body.radius[c]), rng)
        outwards = _unit_vector(rng)
        point = surface + rng.uniform(0.0, _NEAR_M) * (outwards if outwards @ normal >= 0 else -outwards)
        if _outside(model.capsules, kin, point):
            return point


def _on_surface(a: FloatArray, b: FloatArray, radius: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw a point on a capsule, even over its surface, with its normal, (3,) each."""
    axis = b - a
    length = float(np.linalg.norm(axis))
    normal = _unit_vector(rng)
    # the side's area 2 pi r l to the area 4 pi r^2 of both caps
    if rng.uniform() < length / (length + 2.0 * radius):
        across = normal - (normal @ axis) * axis / length**2
        normal, foot = across / np.linalg.norm(across), a + rng.uniform() * axis
    else:
        foot = b if normal @ axis > 0 else a
    return foot + radius * normal, normal


def _outside(body: Capsules, kin: Kinematics, point: FloatArray) -> bool:
    none, ahead = np.zeros(1, np.int64), np.array([[0.0, 0.0, 1.0]])
    return bool(closest_points(kin, body, np.zeros(3), none, point[None], ahead).body_distance[0] >= 0)


def answers(model: RobotModel, params: Profile, q: FloatArray, obstacles: Obstacles, heading: FloatArray) -> Answers:
    """Solve for one posture q (n,) [rad]: hard and soft rows, within the velocity limits and from rest.

    The task moves the end-effector along the unit vector `heading` (3,), slowed by eq. 3, without turning it.
    """
    arm, kin, task = model.description, model.kinematics(q), params.task
    scale = speed_scale(float(obstacles.ee_distance.min()), params.d_max_m)
    twist = np.concatenate([task.speed_m_s * scale * heading, np.zeros(3)])
    cost = task_cost(model.ee_jacobian(kin), twist, q, model.q_mid, task)
    approach = of_table_i(params.approach)
    hard, _ = approach_rows(kin, model.moved_by, obstacles, replace(approach, rows="hard"))
    limits = joint_limits(model, 0.0, task.control_period_s)
    rest, weight = np.zeros(model.n), approach.slack_weight
    boxes = {"velocity": (-arm.qd_max, arm.qd_max), "rest": joint_box(q, rest, limits)}
    soft = ApproachRows(hard.G, hard.h, soft=True)
    slack = {name: float(solve(cost, *box, soft, weight, rest).slack.max(initial=0.0)) for name, box in boxes.items()}
    failed = {
        name: solve(cost, *box, hard, weight, rest).outcome is not QpOutcome.SOLVED for name, box in boxes.items()
    }
    every_row, _ = approach_rows(kin, model.moved_by, obstacles, replace(approach, d_notice_m=1e3))
    fastest = float(np.abs(every_row.G[0]) @ arm.qd_max)
    link = int(obstacles.link[0])
    return Answers(link, fastest, failed["velocity"], failed["rest"], slack["velocity"], slack["rest"])


def results(found: list[Answers], links: tuple[str, ...]) -> Row:
    """Numbers of one batch, in all and by the link that is nearest to the first point."""
    by_link = {}
    for link, name in enumerate(links):
        group = [a for a in found if a.link == link]
        if group:
            by_link[name] = {
                "postures": len(group),
                "never": sum(a.never for a in group),
                "at_once": sum(a.at_once for a in group),
                "fastest_m_s": rounded(float(np.median([a.fastest_m_s for a in group])), 4),
            }
    return {
        "postures": len(found),
        "never": sum(a.never for a in found),
        "at_once": sum(a.at_once for a in found),
        **_slack("slack", [a.slack_m_s for a in found]),
        **_slack("slack_at_once", [a.slack_at_once_m_s for a in found]),
        "by_link": by_link,
    }


def _slack(name: str, values: list[float]) -> dict[str, float]:
    """Median, 90 % and largest of the largest violations [m/s]."""
    middle, high = np.percentile(values, [50, 90])
    return {
        f"{name}_median_m_s": rounded(middle, 5),
        f"{name}_p90_m_s": rounded(high, 5),
        f"{name}_largest_m_s": rounded(max(values), 5),
    }


_TOTALS = ("postures", "never", "at_once")
_MEASURES = tuple(f"{box}_{what}_m_s" for box in ("slack", "slack_at_once") for what in ("median", "p90", "largest"))


def summarise(rows: list[Row]) -> Row:
    """Cells by number of points, and the postures with one point by the link it is nearest to."""
    single = [row for row in rows if row["points"] == 1.0]
    parts = [
        {"link": link, "profile": row["profile"]} | part for row in single for link, part in row["by_link"].items()
    ]
    by = ("points", "profile")
    cells = cells_of(rows, by, _MEASURES, totals=_TOTALS)
    for cell, (_, group) in zip(cells, grouped(rows, by), strict=True):
        cell |= {name: max(row[name] for row in group) for name in _MEASURES if "largest" in name}
    links = cells_of(parts, ("link", "profile"), ("fastest_m_s",), totals=_TOTALS)
    return {"cells": cells, "links": sorted(links, key=lambda cell: (cell["profile"], cell["link"]))}


def tables(part: Row) -> list[TextTable]:
    """Show how often rows cannot be met, by the number of points and by link."""
    made = [_by_count(part["cells"])]
    return [*made, _by_link(part["links"])] if part["links"] else made


def _percent(name: str) -> Callable[[Row], str]:
    return lambda cell: f"{100 * cell[name] / cell['postures']:.1f}"


def _by_count(cells: list[Row]) -> TextTable:
    columns = (
        ("points", plain("points", ".0f")),
        ("profile", plain("profile")),
        ("n", plain("postures")),
        ("never\n[%]", _percent("never")),
        ("at once\n[%]", _percent("at_once")),
        ("slack\nmedian", median("slack_median_m_s", 4)),
        ("\n90 %", median("slack_p90_m_s", 4)),
        ("\nlargest", plain("slack_largest_m_s", ".3f")),
        ("at once\nmedian", median("slack_at_once_median_m_s", 4)),
        ("\n90 %", median("slack_at_once_p90_m_s", 4)),
        ("\nlargest", plain("slack_at_once_largest_m_s", ".3f")),
    )
    return tabulated(
        "Points within 0.1 m of the body in random postures: hard rows that cannot be met, and slack instead",
        columns,
        cells,
        "Never: no joint velocities within their limits meet all rows. At once: none that the accelerations allow from"
        " rest in one period. Slack: by how much [m/s] the worst soft row of a posture is violated; within the velocity"
        " limits, then from rest. Median and 90 % are medians over the batches.",
    )


def _by_link(links: list[Row]) -> TextTable:
    columns = (
        ("link", plain("link")),
        ("profile", plain("profile")),
        ("n", plain("postures")),
        ("never\n[%]", _percent("never")),
        ("at once\n[%]", _percent("at_once")),
        ("fastest\n[m/s]", median("fastest_m_s", 3)),
    )
    return tabulated(
        "One point: by the link it is nearest to",
        columns,
        links,
        "Fastest: the fastest retreat that the joints' velocity limits allow the closest point of the body, median."
        " Eq. 7 asks for up to 0.04 m/s.",
    )


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: 1.0, summarise, tables)
