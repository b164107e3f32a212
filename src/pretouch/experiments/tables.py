"""The summaries as tables, for the terminal and for the page."""

from dataclasses import dataclass
from typing import Any

Row = dict[str, Any]


@dataclass(frozen=True)
class TextTable:
    """A table of finished text."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str


def tables(summary: dict[str, Any]) -> list[TextTable]:
    """All tables of a summary."""
    made = []
    if "static" in summary:
        made.append(_static(summary["static"]))
    if "avoidance" in summary:
        made.append(_avoidance(summary["avoidance"]))
    if "dynamic" in summary:
        made.append(_dynamic(summary["dynamic"]))
    return made


_STATIC = (
    ("impact_speed_m_s", "impact\n[m/s]", 3),
    ("detection_delay_s", "delay\n[ms]", 0),
    ("filtered_at_detection_n", "filtered\n[N]", 1),
    ("raw_at_detection_n", "raw\n[N]", 1),
    ("peak_estimate_n", "peak\n[N]", 1),
    ("true_peak_20ms_n", "true\n[N]", 1),
)


def _static(part: Row) -> TextTable:
    rows: list[tuple[str, ...]] = []
    for cell in part["cells"]:
        place = {key: cell[key] for key in ("trajectory", "side", "profile")}
        numbers = [_number(cell[key], digits, 1000 if "delay" in key else 1) for key, _, digits in _STATIC]
        felt = f"{100 * cell['contact_fraction']:.0f}/{100 * cell['detected_fraction']:.0f}"
        where = f"{cell['trajectory']} {cell['side']}"
        rows.append((where, cell["profile"], *numbers, felt, str(cell["false_detections"])))
        for ratio in part["ratios"]:
            if all(ratio[key] == value for key, value in place.items()):
                ratios = ["" if "delay" in key else _ratio(ratio[key]) for key, _, _ in _STATIC]
                rows.append(("", "ratio", *ratios, "", ""))
    return TextTable(
        "Static object: medians; ratios blind/profile with their 10-90 % below",
        ("where", "profile", *(label for _, label, _ in _STATIC), "hit/felt\n[%]", "false"),
        tuple(rows),
        "Impact: closing speed of the point that touches first. Delay: from the true force passing 1 N. Filtered"
        " (eq. 8) and raw: the estimate at detection. Peak: of the estimate. True: peak of the true force, 20 ms"
        " mean. The paper finds forces about two times smaller with proximity; which force is meant decides the"
        " number.",
    )


def _dynamic(part: Row) -> TextTable:
    rows = tuple(
        (
            cell["profile"],
            f"{cell['detected']} of {cell['pushes']}",
            _number(cell["delay_s"], 0, 1000),
            _number(cell["direction_error_deg"], 1),
            _number(cell["peak_estimate_n"], 1),
            str(cell["reactions_towards_person"]),
            str(cell["false_detections"]),
        )
        for cell in part["cells"]
    )
    return TextTable(
        "A person pushes the moving arm: medians",
        ("profile", "felt", "delay\n[ms]", "direction\n[deg]", "peak\n[N]", "towards\nperson", "false"),
        rows,
        "Pushes of 15 to 30 N for 0.2 to 0.5 s. Direction: between reaction and true force. Peak: of the estimate."
        " Towards person: pushes after which a reaction began against the push.",
    )


def _avoidance(part: Row) -> TextTable:
    rows = tuple(
        (
            cell["place"],
            cell["profile"],
            f"{100 * cell['contact_fraction']:.0f}",
            _number(cell["true_peak_n"], 1),
            _number(cell["least_gap_m"], 3),
            _number(cell["deviation_m"], 3),
            _number(cell["least_speed_scale"], 2),
            _number(cell["travelled_m"], 2),
            str(cell["false_detections"]),
        )
        for cell in part["cells"]
    )
    return TextTable(
        "A person holds a hand beside the path or into it: medians",
        (
            "hand",
            "profile",
            "contact\n[%]",
            "true\n[N]",
            "least\ngap [m]",
            "off path\n[m]",
            "least\nspeed",
            "way\n[m]",
            "false",
        ),
        rows,
        "Beside is 3 cm clear of the robot's hand on its free path, inside half of the person's hand is in its way."
        " True: peak of the true force. Gap: between the person's hand and the arm, negative in contact. Least speed:"
        " factor of eqs. 3 and 4. Way: travelled along the path in 40 s.",
    )


def _number(value: Row | None, digits: int, factor: float = 1.0) -> str:
    return "-" if value is None else f"{factor * value['median']:.{digits}f}"


def _ratio(value: Row | None) -> str:
    return "-" if value is None else f"{value['median']:.2f}\n{value['p10']:.1f}-{value['p90']:.1f}"
