"""The summaries of the three experiments as tables, for the terminal and for the page."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pretouch.text_table import Column, TextTable, tabulated
from pretouch_lab.rows import Row

_STATIC = (
    ("impact_speed_m_s", "impact\n[m/s]", 3),
    ("detection_delay_s", "delay\n[ms]", 0),
    ("filtered_at_detection_n", "filtered\n[N]", 1),
    ("raw_at_detection_n", "raw\n[N]", 1),
    ("peak_estimate_n", "peak\n[N]", 1),
    ("true_peak_20ms_n", "true\n20 ms", 1),
    ("true_peak_n", "true\n[N]", 1),
)


_MEANT = {
    "slowing-only": "slowing-only: eqs. 3-4 without F_obs.",
    "thresholds-only": "thresholds-only: F_obs without eqs. 3-4.",
    "paper-0.5m": "paper-0.5m: objects count within the 0.5 m of the paper's text instead of Table I's 0.8 m.",
    "pretouch": "pretouch: slower where it has to be to brake in time, and contacts detected by the joint torques.",
}
_SHOWN_STIFFNESS = 25_000.0
_UNSAID = ("off", "braking")
"""Restriction modes that the title does not name: without rows, and the one `pretouch` always has."""


def static_tables(part: Row) -> list[TextTable]:
    """Show each place at one stiffness, then what stiffness, profile and restrictions change, places together."""
    cells = part["cells"]
    stiffness, modes, shown = shown_controllers(cells)
    made = [_places(part, stiffness, {name: modes[name] for name in shown})]
    if len(_values(cells, "stiffness_n_per_m")) > 1 or len(_values(cells, "profile")) > 2:
        made.append(_stiffnesses(part, modes))
    if len({(cell["profile"], cell["restrictions"]) for cell in cells}) > len(_values(cells, "profile")):
        made.append(_restrictions(part, stiffness))
    return made


def shown_controllers(cells: list[Row]) -> tuple[float, dict[str, str], list[str]]:
    """Choose of many cells what to show in detail.

    Returns:
        A stiffness [N/m], the restriction mode of each profile (`off` if it has cells with that), and the names of one
        to three profiles, `blind` first and `pretouch` last.
    """
    stiffnesses, profiles = _values(cells, "stiffness_n_per_m"), _values(cells, "profile")
    others = [name for name in profiles if name not in ("blind", "pretouch")]
    shown = [name for name in ("blind", *others[:1], "pretouch") if name in profiles]
    shown = shown if "blind" in profiles else profiles[:1]
    modes: dict[str, str] = {}
    for cell in cells:
        if cell["restrictions"] == "off" or cell["profile"] not in modes:
            modes[cell["profile"]] = cell["restrictions"]
    return _SHOWN_STIFFNESS if _SHOWN_STIFFNESS in stiffnesses else stiffnesses[0], modes, shown


def _values(cells: list[Row], name: str) -> list[Any]:
    return list(dict.fromkeys(cell[name] for cell in cells))


def _places(part: Row, stiffness: float, modes: dict[str, str]) -> TextTable:
    with_mode = "".join(f", {mode} restrictions" for mode in dict.fromkeys(modes.values()) if mode not in _UNSAID)
    cells = [
        cell
        for cell in part["cells"]
        if cell["stiffness_n_per_m"] == stiffness and cell["restrictions"] == modes.get(cell["profile"])
    ]
    where = ("profile\nwhere", lambda cell: f"{cell['profile']}\n{cell['trajectory']} {cell['side']}")
    return _with_ratios(
        f"Static object, {stiffness / 1000:g} N/mm{with_mode}: medians and ratios blind/profile, 10-90 % below",
        (where, *_FORCES, ("detected", _detected)),
        cells,
        part["ratios"],
        "Impact: closing speed of the point that touches first. Delay: from the true force passing 1 N. Filtered"
        " (eq. 8) and raw: the estimate at detection. Peak: of the estimate. True: peak of the true force, of its 20 ms"
        " mean and of itself. Detected: of all contacts. The paper finds forces about two times smaller"
        " with proximity; which force is meant decides the number. False detections:"
        f" {sum(cell['false_detections'] for cell in cells)}.",
    )


def _detected(cell: Row) -> str:
    return f"{cell['detected_fraction'] * cell['trials']:.0f}/{cell['contact_fraction'] * cell['trials']:.0f}"


def _stiffnesses(part: Row, modes: dict[str, str]) -> TextTable:
    what = ("profile\nobject", lambda cell: f"{cell['profile']}\n{cell['stiffness_n_per_m'] / 1000:g} N/mm")
    return _with_ratios(
        "Static object, by stiffness and by what proximity is used for: all four places together",
        (what, *_FORCES),
        [cell for cell in part["pooled_cells"] if cell["restrictions"] == modes[cell["profile"]]],
        part["pooled_ratios"],
        " ".join(said for name, said in _MEANT.items() if name in _values(part["pooled_cells"], "profile")),
    )


def _with_ratios(title: str, columns: tuple[Column, ...], cells: list[Row], ratios: list[Row], note: str) -> TextTable:
    """Make a table of cells, each with its ratio to `blind` below it if there is one."""
    made = tabulated(title, columns, cells, note, names=1)
    rows: list[tuple[str, ...]] = []
    for cell, row in zip(cells, made.rows, strict=True):
        rows.append(row)
        for ratio in _its_ratio(ratios, cell):
            shown = ("" if "delay" in key else _ratio(ratio[key]) for key, _, _ in _STATIC)
            rows.append(("ratio", *shown, *[""] * (len(columns) - 1 - len(_STATIC))))
    return replace(made, rows=tuple(rows))


def _restrictions(part: Row, stiffness: float) -> TextTable:
    shown = [
        cell for cell in part["pooled_cells"] if cell["profile"] != "blind" and cell["stiffness_n_per_m"] == stiffness
    ]
    columns = (
        ("profile\nmode", lambda cell: f"{cell['profile']}\n{cell['restrictions']}"),
        ("hit", hits),
        ("least\n[m]", ranged("least_sensed_m", 3)),
        *_FORCES[:-1],
    )
    return tabulated(
        f"Static object, {stiffness / 1000:g} N/mm, by restriction mode: all four places together",
        columns,
        shown,
        "Hit: trials with contact. Least: nearest that anything sensed came to the arm's surface in 40 s or until"
        " contact, by what was sensed.",
        names=1,
    )


def _its_ratio(ratios: list[Row], cell: Row) -> list[Row]:
    """Return the ratio to a cell, if there is one."""
    key = ("trajectory", "side", "stiffness_n_per_m", "profile", "restrictions")
    return [ratio for ratio in ratios if all(ratio.get(k) == cell.get(k) for k in key)]


def dynamic_tables(part: Row) -> list[TextTable]:
    """How the arm answered the pushes."""
    columns = (
        ("profile", lambda cell: controller(cell, part["cells"])),
        ("detected", share("detected", "pushes", between=" of ")),
        ("delay\n[ms]", median("delay_s", 0, 1000)),
        ("direction\n[deg]", median("direction_error_deg", 1)),
        ("peak\n[N]", median("peak_estimate_n", 1)),
        ("towards\nperson", plain("reactions_towards_person")),
        ("false", plain("false_detections")),
    )
    table = tabulated(
        "A person pushes the moving arm: medians",
        columns,
        part["cells"],
        "Pushes of 15 to 30 N for 0.2 to 0.5 s. Direction: between reaction and true force. Peak: of the estimate."
        " Towards person: pushes after which a reaction began against the push.",
        names=1,
    )
    return [table]


def avoidance_tables(part: Row) -> list[TextTable]:
    """What a hand beside the path or in it changes."""
    columns = (
        ("hand", plain("place")),
        ("profile", lambda cell: controller(cell, part["cells"])),
        ("contact\n[%]", plain("contact_fraction", ".0f", 100)),
        ("true\n[N]", median("true_peak_n", 1)),
        ("least\ngap [m]", median("least_gap_m", 3)),
        ("off path\n[m]", median("deviation_m", 3)),
        ("least\nspeed", median("least_speed_scale", 2)),
        ("way\n[m]", median("travelled_m", 2)),
        ("false", plain("false_detections")),
    )
    table = tabulated(
        "A person holds a hand beside the path or into it: medians",
        columns,
        part["cells"],
        "Beside is 3 cm clear of the robot's hand on its free path, inside half of the person's hand is in its way."
        " True: peak of the true force. Gap: between the person's hand and the arm, negative in contact. Least speed:"
        " factor of eqs. 3 and 4. Way: travelled along the path in 40 s.",
    )
    return [table]


def controller(cell: Row, cells: list[Row]) -> str:
    """Name a cell's profile, and its restriction mode where the profile has cells with several."""
    modes = {c["restrictions"] for c in cells if c["profile"] == cell["profile"]}
    return f"{cell['profile']}\n{cell['restrictions']}" if len(modes) > 1 else str(cell["profile"])


def number(value: Row | None, digits: int, factor: float = 1.0) -> str:
    """Write the median of a spread, or a dash where there is none."""
    return "-" if value is None else f"{factor * value['median']:.{digits}f}"


def plain(key: str, written: str = "", factor: float | None = None) -> Callable[[Row], str]:
    """Write a row's value in a format, times a factor if one is given."""
    return lambda row: format(row[key] if factor is None else factor * row[key], written)


def median(key: str, digits: int, factor: float = 1.0) -> Callable[[Row], str]:
    """Write the median of a row's spread by `number`."""
    return lambda row: number(row[key], digits, factor)


def share(key: str, whole: str = "trials", between: str = "/") -> Callable[[Row], str]:
    """Write how many of a row's trials, or of another number of it."""
    return lambda row: f"{row[key]}{between}{row[whole]}"


def with_spread(value: Row | None, digits: int, factor: float = 1.0) -> str:
    """Write the median of a spread with its 10-90 % below, these with fewer digits where they are large."""
    if value is None:
        return "-"
    few = 0 if factor * value["p90"] >= 10 else min(digits, 2)
    return f"{factor * value['median']:.{digits}f}\n{factor * value['p10']:.{few}f}-{factor * value['p90']:.{few}f}"


def ranged(key: str, digits: int, factor: float = 1.0) -> Callable[[Row], str]:
    """Write a row's spread by `with_spread`."""
    return lambda row: with_spread(row[key], digits, factor)


def hits(row: Row) -> str:
    """Write in how many of a row's trials there was a contact."""
    return f"{row['contact_fraction'] * row['trials']:.0f}/{row['trials']}"


def _ratio(value: Row | None) -> str:
    return "-" if value is None else f"{value['median']:.2f}\n{value['p10']:.1f}-{value['p90']:.1f}"


_FORCES = tuple((label, ranged(key, digits, 1000 if "delay" in key else 1)) for key, label, digits in _STATIC)
"""Columns of the forces and speeds of a contact with a static object."""
