"""Where another baseline does better than `pretouch`: every cell of it."""

from pretouch.text_table import TextTable
from pretouch_lab.benchmarks.ablations import BASE
from pretouch_lab.run import Row
from pretouch_lab.table import grouped

_LESS = (
    ("true_peak_20ms_n", "true 20 ms [N]", 1.0, 1),
    ("clamping_force_n", "clamp [N]", 1.0, 1),
    ("cycle_time_s", "turn [s]", 1.0, 1),
    ("tracking_rms_m", "off path rms [mm]", 1e3, 0),
    ("jerk_rms_rad_s3", "jerk rms [rad/s^3]", 1.0, 0),
    ("held_s", "held [s]", 1.0, 1),
    ("livelock_s", "livelock [s]", 1.0, 1),
)
_MORE = (("least_distance_m", "least distance [mm]", 1e3, 0), ("speed_m_s", "along the path [mm/s]", 1e3, 0))
_NOTICED = 0.05
"""Part of the larger of two values by which they have to differ."""


def losses(cells: list[Row]) -> TextTable:
    """Return each measure of each scenario whose median is better for another baseline by more than 5 %."""
    lines = []
    for key, group in grouped(cells, ("scenario",)):
        ours = next((cell for cell in group if cell["contender"] == BASE), None)
        for name, label, factor, digits in (*_LESS, *_MORE):
            sign = -1.0 if (name, label, factor, digits) in _MORE else 1.0
            better = _better(group, ours, name, sign)
            if ours is None or not better:
                continue
            own = _text(ours[name], factor, digits)
            shown = {cell["contender"]: _text(cell[name], factor, digits) for cell in better}
            said = ", ".join(f"{baseline} {text}" for baseline, text in shown.items() if text != own)
            if said:
                lines.append((key["scenario"], label, own, said))
    return TextTable(
        "Where others do better than pretouch", ("scenario", "median of", "pretouch", "better"), tuple(lines),
        "Every measure of every scenario in which another contender's median is better by more than 5 % and in the"
        " digits shown, whatever it pays for that elsewhere; > is what did not end in its trial.", 2,
    )  # fmt: skip


def _better(group: list[Row], ours: Row | None, name: str, sign: float) -> list[Row]:
    if ours is None or ours[name] is None:
        return []
    own = _value(ours, name)
    ranked = sorted((cell for cell in group if cell[name] is not None), key=lambda cell: sign * _value(cell, name))
    return [
        cell for cell in ranked
        if sign * (own - _value(cell, name)) > _NOTICED * min(max(abs(own), abs(_value(cell, name))), 1e9)
    ]  # fmt: skip


def _value(cell: Row, name: str) -> float:
    return float("inf") if cell[name]["median"] is None else float(cell[name]["median"])


def _text(spread: Row, factor: float, digits: int) -> str:
    # no minus before a zero
    return ">" if spread["median"] is None else f"{round(factor * spread['median'], digits) + 0.0:.{digits}f}"
