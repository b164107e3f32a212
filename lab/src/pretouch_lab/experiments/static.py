"""Paper IV-A: the arm moves into a large static object, on a circle and on a line, from either side."""

from collections.abc import Callable
from itertools import product

import numpy as np

from pretouch.composition import changed
from pretouch.control.approach import BrakingCurve
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant
from pretouch.text_table import TextTable
from pretouch.traces import mean_over
from pretouch.types import ControlStep
from pretouch_lab.experiment import Context, Drawing, Experiment, controllers
from pretouch_lab.options import TrialOptions
from pretouch_lab.run import Row
from pretouch_lab.table import Column, medians, peak, ratios, rounded
from pretouch_lab.trial import Record, play

DEFAULT_RESTRICTIONS = "off"
"""The paper "purposefully allows contact"; at Table I's values its restrictions forbid it."""
TRAJECTORIES = ("circle", "line")
SIDES = ("-y", "+y")

_TIME_LIMIT_S = 40.0
_AFTER_DETECTION_S = 1.0


def cells(options: TrialOptions) -> list[Row]:
    """Return all combinations of stiffness, trajectory, side and controller."""
    return [
        {"trajectory": trajectory, "side": side, "stiffness_n_per_m": stiffness, **controller}
        for stiffness, trajectory, side, controller in product(
            options.stiffness, TRAJECTORIES, SIDES, controllers(options, DEFAULT_RESTRICTIONS)
        )
    ]


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    trajectory, side, where = cell["trajectory"], cell["side"], context.placement
    scene = static_scene(trajectory, side, cell["stiffness_n_per_m"], seed, where)
    profile = context.profile(cell)
    if isinstance(profile.approach, BrakingCurve):  # a task that wants contact: nothing is left untouched
        profile = changed(profile, {"approach.untouched_s": "0"})
    path = static_path(trajectory, side, where)
    record = play(context.setup(cell, seed, scene, path, profile=profile), done_after_contact())
    return results(record, -1.0 if side == "+y" else 1.0, context.model.links), record


def done_after_contact() -> Callable[[ControlStep, Plant], bool]:
    """Return a test that ends a trial a second after the first reaction to a true contact, or at the time limit."""
    detected: list[float] = []

    def done(step: ControlStep, plant: Plant) -> bool:
        if plant.touches and not detected and step.contact is not None:
            detected.append(step.stamp)
        over = bool(detected) and step.stamp >= detected[0] + _AFTER_DETECTION_S
        return over or step.stamp >= _TIME_LIMIT_S

    return done


def results(record: Record, push: float, links: tuple[str, ...]) -> Row:
    """Return the measures of a trial; `push` is the sign of the object's force on the arm along y.

    The impact speed is the true closing speed of the point of the arm that touches first.
    """
    touch = record.first_contact()
    reactions = record.reactions()
    sensed = min((float(s.obstacles.body_distance.min(initial=np.inf)) for s in record.steps), default=np.inf)
    row: Row = {
        "contact": touch is not None,
        "touched_link": None,
        **dict.fromkeys(MEASURES),
        "least_sensed_m": rounded(sensed, 4) if np.isfinite(sensed) else None,
        "false_detections": sum(touch is None or s.stamp < touch for s in reactions),
        "held": record.held(),
    }
    if touch is None:
        return row
    times, along = record.times(), push * record.forces()[:, 1]
    true = np.linalg.norm(record.true_force, axis=1)
    first = record.touches[0]
    row["touched_link"] = links[first.link]
    row["impact_speed_m_s"] = rounded(-push * float(first.velocity[1]), 4)
    row["peak_estimate_n"] = rounded(peak(along[(times >= touch) & np.isfinite(along)]))
    row["true_peak_n"] = rounded(peak(true))
    row["true_peak_20ms_n"] = rounded(peak(mean_over(true, 20)))
    detection = next((s for s in reactions if s.stamp >= touch), None)
    if detection is not None:
        row["detection_delay_s"] = rounded(detection.stamp - touch, 4)
        row["filtered_at_detection_n"] = rounded(push * float(detection.filtered_force[1]))
        row["raw_at_detection_n"] = rounded(push * float(detection.force[1]))
    return row


_FORCES = (
    Column("impact\n[m/s]", "impact_speed_m_s", 3, band=True),
    Column("delay\n[ms]", "detection_delay_s", 0, 1000.0, band=True),
    Column("filtered\n[N]", "filtered_at_detection_n", 1, band=True),
    Column("raw\n[N]", "raw_at_detection_n", 1, band=True),
    Column("peak\n[N]", "peak_estimate_n", 1, band=True),
    Column("true\n20 ms", "true_peak_20ms_n", 1, band=True),
    Column("true\n[N]", "true_peak_n", 1, band=True),
)
MEASURES = tuple(column.key for column in _FORCES)
_SHOWN_STIFFNESS = 25_000.0
_PROFILE = Column("profile\nobject", "profile", second="object")
_BY_OBJECT = (_PROFILE, *_FORCES, Column("detected", "detected", of="contact"))
_BY_OBJECT_NOTE = (
    "Impact: closing speed of the point that touches first. Delay: from 1 N of true force. Filtered (eq. 8) and raw:"
    " the estimate at detection. Peak: of the estimate. True 20 ms, true: peaks of the true force, as 20 ms mean and as"
    " it is. Detected: of all contacts. slowing-only: eqs. 3-4 without F_obs. thresholds-only: F_obs without eqs. 3-4."
    " paper-0.5m: objects count within the 0.5 m of the paper's text instead of Table I's 0.8 m. pretouch: it slows to"
    " brake in time, and detects contacts by the joint torques. False detections: "
)
_RATIOS = tuple(
    Column(c.heading.split("\n")[0], f"{c.key}_ratio", 2, band=True) for c in _FORCES if "delay" not in c.key
)
_RATIOS_NOTE = (
    "The paper reports forces about two times smaller with proximity; the number depends on the compared force."
)
_BY_MODE = (
    Column("profile\nmode", "profile", second="restrictions"),
    Column("hit", "contact", of="trials"),
    Column("least\n[m]", "least_sensed_m", 3, band=True),
    *_FORCES[:-1],
)
_BY_MODE_NOTE = (
    "Hit: trials with contact. Least: least sensed distance of an object from the arm's surface in 40 s or until"
    " contact."
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return tables of forces by profile and stiffness, their ratios to `blind`, and the effects of restrictions."""
    same = ("trajectory", "side", "stiffness_n_per_m", "seed")
    every = [
        row | {"detected": row["detection_delay_s"] is not None, "object": f"{row['stiffness_n_per_m'] / 1000:g} N/mm"}
        for row in ratios(rows, {"profile": "blind"}, same, MEASURES, inverse=True)
    ]
    stiffness, mode, _ = shown_controllers(every)
    named = [row for row in every if row["restrictions"] == mode[row["profile"]]]
    compared = [row for row in named if row["profile"] != "blind" and row["true_peak_n_ratio"]]
    by_object, by_mode, where = ("profile", "object"), ("profile", "restrictions"), "all four places together"
    title, note = f"Static object, {where}: medians, 10-90 % below", f"{sum(r['false_detections'] for r in named)}."
    every_table = [medians(title, _BY_OBJECT, named, by_object, _BY_OBJECT_NOTE + note)]
    if compared:
        title = f"Times smaller than without proximity, {where}: medians, 10-90 % below"
        every_table.append(medians(title, (_PROFILE, *_RATIOS), compared, by_object, _RATIOS_NOTE))
    if len({(row["profile"], row["restrictions"]) for row in every}) > len(mode):
        sensing = [row for row in every if row["profile"] != "blind" and row["stiffness_n_per_m"] == stiffness]
        title = f"Static object, {stiffness / 1000:g} N/mm, by restriction mode: {where}"
        every_table.append(medians(title, _BY_MODE, sensing, by_mode, _BY_MODE_NOTE))
    return every_table


def shown_controllers(rows: list[Row]) -> tuple[float, dict[str, str], list[str]]:
    """Choose the controllers to show in detail.

    Returns:
        A stiffness [N/m], the first restriction mode of each profile, and the names of one to three profiles, `blind`
        first and `pretouch` last.
    """
    stiffnesses = [row["stiffness_n_per_m"] for row in rows]
    mode: dict[str, str] = {}
    for row in rows:
        mode.setdefault(row["profile"], row["restrictions"])
    others = [name for name in mode if name not in ("blind", "pretouch")]
    names = [name for name in ("blind", *others[:1], "pretouch") if name in mode]
    stiffness = _SHOWN_STIFFNESS if _SHOWN_STIFFNESS in stiffnesses else stiffnesses[0]
    return stiffness, mode, names if "blind" in mode else list(mode)[:1]


def shown_cells(rows: list[Row]) -> list[Row]:
    """Return the trials of the figure: each place with up to three profiles."""
    stiffness, mode, names = shown_controllers(rows)
    return [
        row
        for row in rows
        if row["stiffness_n_per_m"] == stiffness
        and row["profile"] in names
        and row["restrictions"] == mode[row["profile"]]
    ]


_FIGURE = Drawing("force-difference", "Force and contact thresholds at the static object", shown_cells, ("blind",))
EXPERIMENT = Experiment("static", cells, trial, tables, _FIGURE, any_arm=True)
