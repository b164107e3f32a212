"""The avoidance benchmark as tables, for the terminal and the document."""

from collections.abc import Callable

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.avoidance.losses import losses
from pretouch_lab.benchmarks.avoidance.scenario import scenarios
from pretouch_lab.run import Row
from pretouch_lab.table import grouped
from pretouch_lab.tables import plain, share, with_spread

_NOTE = (
    "Medians over the seeds, 10-90 % below. hit: trials with contact. least: least true distance of the surfaces."
    " impact: closing speed of the point that touches first. estimate: peak of the force estimate along the contact."
    " true: peak of the 20 ms mean of the true force. clamp: largest mean over 0.5 s of unbroken contact. touch: from"
    " the obstacle being within 0.8 m of the end-effector. turn: time of the second turn, > where the trial ended"
    " before."
)


def tables(summary: Row) -> list[TextTable]:
    """Return what is lost, each baseline in each scenario, a table a family, and ablations."""
    cells, made = summary["cells"], [losses(summary["cells"])]
    made += [_results(family["family"], group) for family, group in grouped(cells, ("family",))]
    made += [_ablations(summary["ablations"])]
    return [table for table in made if table.rows]


def _results(family: str, cells: list[Row]) -> TextTable:
    text = next(s.text for s in scenarios().values() if s.family == family)
    return tabulated(f"{family.capitalize()}: contact and cost", _COLUMNS, cells, f"{text} {_NOTE}")


def _ablations(cells: list[Row]) -> TextTable:
    return tabulated(
        "Each switch of pretouch off alone, in the closed loop",
        _ABLATED,
        [cell for _, found in grouped(cells, ("scenario",)) for cell in found],
        "On fewer seeds than the tables above: pretouch here has the same. The switches of detection are in the tables"
        " of contact detection.",
    )


def value(key: str, digits: int, factor: float = 1.0) -> Callable[[Row], str]:
    """Write a row's spread; `>` stands for what was not over when its trial ended, a dash for none."""

    def write(row: Row) -> str:
        spread = row[key]
        if spread is None:
            return "-"
        if spread["n"] == 1:
            return ">" if spread["median"] is None else f"{factor * spread['median']:.{digits}f}"
        if None in (spread["median"], spread["p10"], spread["p90"]):
            low, middle, high = (
                ">" if spread[name] is None else f"{spread[name]:.{digits}f}" for name in ("p10", "median", "p90")
            )
            return f"{middle}\n{low}-{high}"
        return with_spread(spread, digits, factor)

    return write


_NAMES = ("scenario", plain("scenario")), ("contender", plain("contender"))
_HIT = "hit", share("contacts")
_FORCES = (
    ("estimate\n[N]", value("peak_estimate_n", 1)),
    ("true\n20 ms", value("true_peak_20ms_n", 1)),
    ("clamp\n[N]", value("clamping_force_n", 1)),
    ("touch\n[s]", value("first_contact_s", 2)),
)
_TURN = "turn\n[s]", value("cycle_time_s", 1)
_COLUMNS = (
    *_NAMES,
    _HIT,
    ("least\n[mm]", value("least_distance_m", 0, 1000.0)),
    ("impact\n[m/s]", value("impact_speed_m_s", 3)),
    *_FORCES,
    ("off path\nrms [m]", value("tracking_rms_m", 3)),
    ("along\n[m/s]", value("speed_m_s", 3)),
    _TURN,
)
_ABLATED = (
    *_NAMES,
    _HIT,
    *_FORCES,
    _TURN,
    ("off path\nrms [mm]", value("tracking_rms_m", 0, 1000.0)),
    ("jerk\nrms", value("jerk_rms_rad_s3", 0)),
    ("false", plain("false_reactions")),
    ("towards\nperson", plain("towards_person")),
    ("holds", plain("holds")),
    ("livelocks", plain("livelocks")),
)
