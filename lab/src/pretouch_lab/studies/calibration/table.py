"""The calibration study as tables, for the terminal and for the page."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.rows import Row
from pretouch_lab.studies.calibration.study import OURS, WATANABE, WATANABE_UNBIASED, Study

ALL = "all"
_ORDER = OURS, WATANABE, WATANABE_UNBIASED

_MILLI = 1000.0


def tables(study: Study) -> list[TextTable]:
    """Show our answers by link, then all pairs of method and motion."""
    shown = [by_link(study)]
    return [*shown, by_method(study)] if study.of(WATANABE, OURS) else shown


def by_link(study: Study) -> TextTable:
    """Show how far our answers are off, and whether they say so."""
    rows = study.rows()
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
        f"Where units sit, found in {study.motion_s[OURS]:.0f} s of motion:"
        f" {len(links)} units on each of {len(rows) // len(links)} random skins",
        columns,
        [*links.items(), (ALL, rows)],
        "Medians; NEES, the error squared over its covariance, are means: 3, 3 and 6 if the covariance is honest."
        " Sigma: in the worst direction. Clock: error of the found offset, which is up to 20 ms either way. Computing"
        f" takes {study.compute_s():.1f} s a skin. Sensor errors are the data sheet's; how a board is glued on is left"
        " out, for no IMU can tell it.",
        names=1,
    )


def by_method(study: Study) -> TextTable:
    """Show error, motion and computing time of both methods on both motions."""
    pairs = dict.fromkeys((trial.method, trial.motion) for trial in study.trials)
    columns = (
        ("method", lambda named: named[0][0]),
        ("motion", lambda named: named[0][1]),
        ("motion\n[s]", lambda named: f"{study.motion_s[named[0][1]]:.0f}"),
        ("position\n[mm]", _number("position_error_m", 2, np.median, _MILLI)),
        ("90 %\n[mm]", _number("position_error_m", 2, _ninetieth, _MILLI)),
        ("turn\n[deg]", _number("orientation_error_deg", 3, np.median)),
        ("90 %\n[deg]", _number("orientation_error_deg", 3, _ninetieth)),
        ("computing\n[s]", lambda named: f"{study.compute_s(*named[0]):.1f}"),
    )
    return tabulated(
        "Two calibrations on two motions, the same data for both",
        columns,
        [(pair, study.rows(*pair)) for pair in sorted(pairs, key=lambda pair: _ORDER.index(pair[0]))],
        "Medians, and what 90 % of the units are below; computing for all units of a skin. The method of Watanabe et"
        " al. (arXiv 2110.14516) uses the accelerometers only, and estimates neither their biases and scales, which are"
        " most of its error, nor the clocks.",
    )


def _median_size(values: list[float]) -> float:
    return float(np.median(np.abs(values)))


def _ninetieth(values: list[float]) -> float:
    return float(np.percentile(values, 90))


def _number(
    key: str, digits: int, of_all: Callable[[list[float]], float], factor: float = 1.0
) -> Callable[[tuple[Any, list[Row]]], str]:
    """Write a statistic of what named rows say; a dash where none says it."""

    def write(named: tuple[Any, list[Row]]) -> str:
        values = [row[key] for row in named[1] if row[key] is not None]
        return f"{factor * float(of_all(values)):.{digits}f}" if values else "-"

    return write
