"""The calibration study as a table."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.run import Row
from pretouch_lab.studies.calibration.study import Study

ALL = "all"
_MILLI = 1000.0


def by_link(study: Study) -> TextTable:
    """Show how far our answers are off, and whether they say so."""
    rows = study.rows
    links = {link: [row for row in rows if row["link"] == link] for link in dict.fromkeys(row["link"] for row in rows)}
    columns = (
        ("link", lambda named: named[0]),
        ("found", lambda named: f"{sum(row['link_found'] for row in named[1])}/{len(named[1])}"),
        ("place\n[mm]", _number("position_error_m", 2, np.median, _MILLI)),
        ("most\n[mm]", _number("position_error_m", 2, np.max, _MILLI)),
        ("sigma\n[mm]", _number("position_sigma_m", 2, np.median, _MILLI)),
        ("turn\n[deg]", _number("orientation_error_deg", 3, np.median)),
        ("most\n[deg]", _number("orientation_error_deg", 3, np.max)),
        ("sigma\n[deg]", _number("orientation_sigma_deg", 3, np.median)),
        ("NEES\nplace", _number("nees_position", 1, np.mean)),
        ("NEES\nturn", _number("nees_orientation", 1, np.mean)),
        ("NEES\nboth", _number("nees_pose", 1, np.mean)),
        ("clock\n[ms]", _number("clock_error_s", 2, _median_size, _MILLI)),
    )
    return tabulated(
        f"Where units sit, found in {study.motion_s:.0f} s of motion:"
        f" {len(links)} units on each of {len(rows) // len(links)} random skins",
        columns,
        [*links.items(), (ALL, rows)],
        "Medians; NEES, the error squared over its covariance, are means: 3, 3 and 6 if the covariance is honest."
        " Sigma: in the worst direction. Clock: error of the found offset, which is up to 20 ms either way. Computing"
        f" takes {study.compute_s:.1f} s a skin. Sensor errors are the data sheet's; how a board is glued on is left"
        " out, for no IMU can tell it.",
        names=1,
    )


def _median_size(values: list[float]) -> float:
    return float(np.median(np.abs(values)))


def _number(
    key: str, digits: int, of_all: Callable[[list[float]], float], factor: float = 1.0
) -> Callable[[tuple[Any, list[Row]]], str]:
    """Write a statistic of what named rows say; a dash where none says it."""

    def write(named: tuple[Any, list[Row]]) -> str:
        values = [row[key] for row in named[1] if row[key] is not None]
        return f"{factor * float(of_all(values)):.{digits}f}" if values else "-"

    return write
