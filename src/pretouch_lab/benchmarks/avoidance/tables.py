"""The avoidance benchmark as tables, for the terminal and the document."""

from pretouch.text_table import TextTable
from pretouch_lab.benchmarks.avoidance.losses import losses
from pretouch_lab.benchmarks.avoidance.scenario import scenarios
from pretouch_lab.rows import Row, grouped
from pretouch_lab.tables import with_spread

_COLUMNS = (
    ("least_distance_m", "least\n[mm]", 0),
    ("impact_speed_m_s", "impact\n[m/s]", 3),
    ("peak_estimate_n", "estimate\n[N]", 1),
    ("true_peak_20ms_n", "true\n20 ms", 1),
    ("clamping_force_n", "clamp\n[N]", 1),
    ("first_contact_s", "touch\n[s]", 2),
    ("tracking_rms_m", "off path\nrms [m]", 3),
    ("speed_m_s", "along\n[m/s]", 3),
    ("cycle_time_s", "turn\n[s]", 1),
)
_MOTION = (
    ("off_path_max_m", "off path\nmost [m]", 2),
    ("jerk_max_rad_s3", "jerk most\n[rad/s^3]", 0),
    ("jerk_max_per_second_rad_s3", "each\nsecond", 0),
    ("jerk_rms_rad_s3", "rms", 0),
    ("manipulability_ee_least", "manip.\nhand", 3),
    ("manipulability_point", "manip.\npoint", 3),
    ("mobility_point_m", "mobility\n[m]", 2),
    ("held_s", "held\n[s]", 1),
    ("livelock_s", "livelock\n[s]", 1),
    ("seen_fraction", "seen", 2),
)
_COUNTS = (
    ("holds", "holds"),
    ("livelocks", "livelocks"),
    ("false_reactions", "false"),
    ("towards_person", "towards\nperson"),
    ("solver_failures", "solver\nfailed"),
    ("infeasible", "no\nsolution"),
)
_ABLATED = (
    ("peak_estimate_n", "estimate\n[N]", 1),
    ("true_peak_20ms_n", "true\n20 ms", 1),
    ("clamping_force_n", "clamp\n[N]", 1),
    ("first_contact_s", "touch\n[s]", 2),
    ("cycle_time_s", "turn\n[s]", 1),
    ("tracking_rms_m", "off path\nrms [mm]", 0),
    ("jerk_rms_rad_s3", "jerk\nrms", 0),
)
_NOTE = (
    "Medians over the seeds, 10-90 % below. hit: trials with contact. least: least true distance of the surfaces."
    " impact: closing speed of the point that touches first. estimate: peak of the force estimate along the contact."
    " true: peak of the 20 ms mean of the true force. clamp: largest mean over 0.5 s of unbroken contact. touch: from"
    " the obstacle being within 0.8 m of the end-effector. turn: time of the second turn, > where the trial ended"
    " before."
)
_MOTION_NOTE = (
    "jerk: of the commanded joint velocities, the largest of all, the median over seconds of each second's largest, and"
    " rms. manip.: least manipulability of the hand's velocity, and median of that of the body point nearest to the"
    " obstacle while it is within 0.6 m. mobility: speed of that point towards the obstacle per joint speed. livelock:"
    " see the scenario files. seen: share of the time within 0.6 m in which the controller knew a point of it."
    " false: reactions without a contact. towards person: reactions against the force they answer or echo. no solution:"
    " control steps whose hard rows contradict the acceleration limits."
)


def tables(summary: Row) -> list[TextTable]:
    """Return what is lost, each contender in each scenario, a table a family, the motion, ablations, and ratios."""
    cells, made = summary["cells"], [losses(summary["cells"])]
    made += [_results(family["family"], group) for family, group in grouped(cells, ("family",))]
    made += [_motion(family["family"], group) for family, group in grouped(cells, ("family",))]
    made += [_ablations(summary["ablations"])]
    made += [_ratios(ref["reference"], part) for ref, part in grouped(summary["ratios"], ("reference",))]
    return [table for table in made if table.rows]


def _results(family: str, cells: list[Row]) -> TextTable:
    text = next(s.text for s in scenarios().values() if s.family == family)
    rows = tuple(
        (cell["scenario"], cell["contender"], f"{cell['contacts']}/{cell['trials']}", *_shown(cell, _COLUMNS))
        for cell in cells
    )
    header = ("scenario", "contender", "hit", *(label for _, label, _ in _COLUMNS))
    return TextTable(f"{family.capitalize()}: contact and cost", header, rows, f"{text} {_NOTE}")


def _motion(family: str, cells: list[Row]) -> TextTable:
    rows = tuple(
        (
            cell["scenario"], cell["contender"], *_shown(cell, _MOTION), *(str(cell[key]) for key, _ in _COUNTS),
        )
        for cell in cells
    )  # fmt: skip
    header = ("scenario", "contender", *(label for _, label, _ in _MOTION), *(label for _, label in _COUNTS))
    return TextTable(f"{family.capitalize()}: motion, holds and reactions", header, rows, _MOTION_NOTE)


def _ablations(cells: list[Row]) -> TextTable:
    counts = ("false_reactions", "towards_person", "holds", "livelocks")
    rows = tuple(
        (
            group["scenario"], cell["contender"], f"{cell['contacts']}/{cell['trials']}", *_shown(cell, _ABLATED),
            *(str(cell[key]) for key in counts),
        )
        for group, found in grouped(cells, ("scenario",)) for cell in found
    )  # fmt: skip
    return TextTable(
        "Each switch of pretouch off alone, in the closed loop",
        ("scenario", "contender", "hit", *(label for _, label, _ in _ABLATED), "false", "towards\nperson", "holds",
         "livelocks"),
        rows,
        "On fewer seeds than the tables above: pretouch here has the same. The switches of detection are in the tables"
        " of contact detection.",
    )  # fmt: skip


def _shown(cell: Row, columns: tuple[tuple[str, str, int], ...]) -> list[str]:
    return [value(cell[key], digits, _FACTORS.get(label[-4:], 1.0)) for key, label, digits in columns]


_FACTORS = {"[mm]": 1000.0}


def value(spread: Row | None, digits: int, factor: float = 1.0) -> str:
    """Write a spread; `>` stands for what was not over when its trial ended, a dash for none."""
    if spread is None:
        return "-"
    if spread["n"] == 1:
        return ">" if spread["median"] is None else f"{factor * spread['median']:.{digits}f}"
    if None in (spread["median"], spread["p10"], spread["p90"]):
        low, middle, high = (
            ">" if spread[key] is None else f"{spread[key]:.{digits}f}" for key in ("p10", "median", "p90")
        )
        return f"{middle}\n{low}-{high}"
    return with_spread(spread, digits, factor)


_RATIO = (
    ("true_peak_20ms_n", "true 20 ms"),
    ("clamping_force_n", "clamp"),
    ("peak_estimate_n", "estimate"),
    ("first_contact_s", "touch time"),
    ("cycle_time_s", "turn"),
    ("tracking_rms_m", "off path"),
)


def _ratios(reference: str, ratios: list[Row]) -> TextTable:
    rows = tuple(
        (row["scenario"], row["contender"], *(value(row[key], 2) for key, _ in _RATIO))
        for row in ratios
        if any(row[key] for key, _ in _RATIO)
    )
    return TextTable(
        f"{reference} over each contender, on the same seeds",
        ("scenario", "contender", *(label for _, label in _RATIO)),
        rows,
        f"Above 1 the contender's is smaller than that of {reference}. Only seeds in which both have one: those without"
        " contact are in the table above.",
    )
