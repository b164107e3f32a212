"""Figures of the experiments in which nothing touches the arm, from their summaries."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.paper.claims.detectors import TABLE_I
from pretouch_lab.rows import Row

_AXES = "xyz"
_LINES, _MARKERS = ("-", "--", ":"), ("o", "s", "^")
_COLOURS = ("tab:blue", "tab:red", "tab:green", "tab:purple", "black", "tab:orange", "tab:gray")
_RATE_MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def free_motion_figure(summary: Row) -> Figure:
    """Band of eq. 9 against speed for each axis; false detections against F_b for each detector."""
    figure = Figure(figsize=(11, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.3])
    cells = summary["cells"]
    for axis, name in enumerate(_AXES):
        _spreads(left, cells, "speed_m_s", "band_n", axis, f"F_b + F_sigma, {name}")
    left.axhline(TABLE_I.f_base_n, color="black", lw=1, ls=(0, (1, 3)))
    left.axhline(TABLE_I.f_base_n + TABLE_I.f_std_n, color="black", lw=1, ls=(0, (1, 3)))
    left.text(0.0, TABLE_I.f_base_n + 0.05, "F_b", fontsize="small")
    left.text(0.0, TABLE_I.f_base_n + TABLE_I.f_std_n + 0.05, "F_b + F_std", fontsize="small")
    left.set(xlabel="speed along the path [m/s]", ylabel="force above the mean that makes a contact [N]")
    left.set_ylim(TABLE_I.f_base_n - 0.5, TABLE_I.f_base_n + TABLE_I.f_std_n + 0.5)
    left.set_title("Thresholds while nothing touches")
    rates = [rate for rate in summary["false_detections"] if rate["detector"] != "fixed"]
    for k, (detector, near) in enumerate(dict.fromkeys((rate["detector"], rate["near"]) for rate in rates)):
        own = [rate for rate in rates if (rate["detector"], rate["near"]) == (detector, near)]
        label = f"{detector}, {'near' if near else 'far'}"
        # side by side, so that markers at the same bound do not hide each other
        forces = [rate["force_n"] + 0.06 * (k - 3.5) for rate in own]
        _rates(right, forces, own, k // 2, label, "--" if near else "-")
    _finish(right, "F_b [N]")
    left.legend(loc="center right", fontsize="small")
    left.grid(alpha=0.3)
    return figure


def noise_figure(summary: Row) -> Figure:
    """Spread of the estimate and F_sigma against the noise; false detections against it for each detector."""
    figure = Figure(figsize=(11, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.3])
    cells = summary["cells"]
    for axis, name in enumerate(_AXES):
        _spreads(left, cells, "noise_factor", "std_n", axis, f"std of the estimate, {name}", "tab:gray")
        _spreads(left, cells, "noise_factor", "f_sigma_n", axis, f"F_sigma, {name}")
    left.axhline(TABLE_I.f_std_n, color="black", lw=1, ls=(0, (1, 3)))
    left.text(cells[-1]["noise_factor"] if cells else 1.0, TABLE_I.f_std_n, "F_std", ha="right", va="bottom")
    left.set(xlabel="noise factor", ylabel="[N]", title="Estimate and F_sigma while nothing touches")
    left.set_ylim(bottom=0.0)
    left.legend(loc="upper left", fontsize="small")
    left.grid(alpha=0.3)
    kinds = dict.fromkeys(_kind(rate) for cell in cells for rate in cell["false_detections"])
    for k, kind in enumerate(kinds):
        own = [(cell, rate) for cell in cells for rate in cell["false_detections"] if _kind(rate) == kind]
        detector, force_n, near = kind
        label = f"fixed {force_n:g} N" if detector == "fixed" else f"{detector}, {'near' if near else 'far'}"
        factors = [cell["noise_factor"] + 0.05 * (k - 3) for cell, _ in own]
        _rates(right, factors, [rate for _, rate in own], k, label, "--" if near else "-")
    _finish(right, "noise factor")
    return figure


def _kind(rate: Row) -> tuple[str, float, bool]:
    return rate["detector"], rate["force_n"], rate["near"]


def _spreads(axes: Axes, cells: list[Row], over: str, key: str, axis: int, label: str, colour: str = "") -> None:
    """Draw medians with their 10-90 % against something of the cells, for one axis of the force."""
    shown = [(cell[over], cell[key][axis]) for cell in cells if cell[key][axis] is not None]
    middle = [value["median"] for _, value in shown]
    below = [value["median"] - value["p10"] for _, value in shown]
    above = [value["p90"] - value["median"] for _, value in shown]
    axes.errorbar(
        [x for x, _ in shown], middle, yerr=[below, above], label=label, color=colour or _COLOURS[axis],
        ls=_LINES[axis], marker=_MARKERS[axis], ms=5, lw=1.2, capsize=3,
    )  # fmt: skip


def _rates(axes: Axes, x: list[float], rates: list[Row], kind: int, label: str, style: str) -> None:
    """Draw rates with their bounds; where nothing was counted, the upper bound as an empty marker."""
    colour, marker = _COLOURS[kind], _RATE_MARKERS[kind]
    points = list(zip(x, rates, strict=True))
    counted = [(at, rate) for at, rate in points if rate["count"]]
    below = [rate["per_hour"] - rate["low_per_hour"] for _, rate in counted]
    above = [rate["high_per_hour"] - rate["per_hour"] for _, rate in counted]
    axes.errorbar(
        [at for at, _ in counted], [rate["per_hour"] for _, rate in counted], yerr=[below, above], label=label,
        color=colour, ls=style, marker=marker, ms=6, lw=1.2, capsize=3,
    )  # fmt: skip
    none = [(at, rate) for at, rate in points if not rate["count"]]
    bounds = [rate["high_per_hour"] for _, rate in none]
    axes.plot([at for at, _ in none], bounds, color=colour, ls="none", marker=marker, ms=6, mfc="white")


def _finish(axes: Axes, over: str) -> None:
    axes.set_yscale("log")
    axes.set(xlabel=over, ylabel="false detections [1/h]", title="False detections (empty: none, at its upper bound)")
    if axes.lines:
        axes.legend(fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=4)
    axes.grid(alpha=0.3)
