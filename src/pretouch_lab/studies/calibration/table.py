"""The calibration study as tables, for the terminal and for the page."""

from collections.abc import Callable

import numpy as np

from pretouch.text_table import TextTable
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
    links = list(dict.fromkeys(row["link"] for row in rows))
    shown = [_line(link, [row for row in rows if row["link"] == link]) for link in links]
    return TextTable(
        f"Where units sit, found in {study.motion_s[OURS]:.0f} s of motion:"
        f" {len(links)} units on each of {len(rows) // len(links)} random skins",
        (
            "link", "found", "place\n[mm]", "most\n[mm]", "sigma\n[mm]", "turn\n[deg]", "most\n[deg]", "sigma\n[deg]",
            "NEES\nplace", "NEES\nturn", "NEES\nboth", "clock\n[ms]",
        ),
        (*shown, _line(ALL, rows)),
        "Medians; NEES, the error squared over its covariance, are means: 3, 3 and 6 if the covariance is honest."
        " Sigma: in the worst direction. Clock: error of the found offset, which is up to 20 ms either way. Computing"
        f" takes {study.compute_s():.1f} s a skin. Sensor errors are the data sheet's; how a board is glued on is left"
        " out, for no IMU can tell it.",
        names=1,
    )  # fmt: skip


def _line(name: str, rows: list[Row]) -> tuple[str, ...]:
    found = sum(row["link_found"] for row in rows)
    return (
        name,
        f"{found}/{len(rows)}",
        _number(rows, "position_error_m", 2, np.median, _MILLI),
        _number(rows, "position_error_m", 2, np.max, _MILLI),
        _number(rows, "position_sigma_m", 2, np.median, _MILLI),
        _number(rows, "orientation_error_deg", 3, np.median),
        _number(rows, "orientation_error_deg", 3, np.max),
        _number(rows, "orientation_sigma_deg", 3, np.median),
        _number(rows, "nees_position", 1, np.mean),
        _number(rows, "nees_orientation", 1, np.mean),
        _number(rows, "nees_pose", 1, np.mean),
        _number(rows, "clock_error_s", 2, _median_size, _MILLI),
    )  # fmt: skip


def by_method(study: Study) -> TextTable:
    """Show error, motion and computing time of both methods on both motions."""
    shown = []
    for method, motion in dict.fromkeys((trial.method, trial.motion) for trial in study.trials):
        rows = study.rows(method, motion)
        shown.append((
            method,
            motion,
            f"{study.motion_s[motion]:.0f}",
            _number(rows, "position_error_m", 2, np.median, _MILLI),
            _number(rows, "position_error_m", 2, _ninetieth, _MILLI),
            _number(rows, "orientation_error_deg", 3, np.median),
            _number(rows, "orientation_error_deg", 3, _ninetieth),
            f"{study.compute_s(method, motion):.1f}",
        ))  # fmt: skip
    return TextTable(
        "Two calibrations on two motions, the same data for both",
        (
            "method", "motion", "motion\n[s]", "position\n[mm]", "90 %\n[mm]", "turn\n[deg]", "90 %\n[deg]",
            "computing\n[s]",
        ),
        tuple(sorted(shown, key=lambda line: _ORDER.index(line[0]))),
        "Medians, and what 90 % of the units are below; computing for all units of a skin. The method of Watanabe et"
        " al. (arXiv 2110.14516) uses the accelerometers only, and estimates neither their biases and scales, which are"
        " most of its error, nor the clocks.",
    )  # fmt: skip


def _median_size(values: list[float]) -> float:
    return float(np.median(np.abs(values)))


def _ninetieth(values: list[float]) -> float:
    return float(np.percentile(values, 90))


def _number(rows: list[Row], key: str, digits: int, of_all: Callable[[list[float]], float], factor: float = 1.0) -> str:
    """Write a statistic of what rows say; a dash where none says it."""
    values = [row[key] for row in rows if row[key] is not None]
    return f"{factor * float(of_all(values)):.{digits}f}" if values else "-"
