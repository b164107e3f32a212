"""A figure of decisions: the force along each axis between moving thresholds, one column a profile."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch.recording.compare import Decisions
from pretouch.types import FloatArray

_AXES = "xyz"


def decisions_figure(columns: Sequence[Decisions], title: str) -> Figure:
    """Draw force, value of eq. 8, thresholds and contacts of each detector, on one scale."""
    figure = Figure(figsize=(3 + 5 * len(columns), 8), layout="constrained")
    panels = figure.subplots(3, len(columns), sharex=True, sharey="row", squeeze=False)
    for column, decisions in zip(panels.T, columns, strict=True):
        count = len(decisions.contacts)
        name = decisions.name.replace(":", "\n")
        column[0].set_title(f"{name}\n{count} contact{'s' * (count != 1)}", fontsize="medium")
        for axis, axes in enumerate(column):
            _panel(axes, decisions, axis)
        column[-1].set_xlabel("time [s]")
    for axis, axes in enumerate(panels[:, 0]):
        axes.set_ylabel(f"force along {_AXES[axis]} [N]")
    found = [axes.get_legend_handles_labels() for axes in panels[0]]
    shown = {label: handle for pair in found for handle, label in zip(*pair, strict=True)}
    figure.legend(list(shown.values()), list(shown), loc="outside lower center", ncols=5, fontsize="small")
    figure.suptitle(title, fontsize="medium")
    return figure


def _panel(axes: Axes, d: Decisions, axis: int) -> None:
    axes.plot(d.time, d.force[:, axis], color="0.7", lw=0.8, label="estimate")
    axes.plot(d.time, d.compared[:, axis], color="tab:blue", lw=1.2, label="held against the thresholds")
    for bound, label in ((d.upper, "thresholds"), (d.lower, None)):
        axes.plot(d.time, _where(bound[:, axis], d), color="black", lw=1, label=label)
    for i, contact in enumerate(d.contacts):
        crossed = bool(contact.axes[axis])
        label = "contact (filled: this axis)" if i == 0 else None
        axes.axvline(contact.time, color="tab:red", lw=1, ls="-" if crossed else ":")
        axes.plot(
            contact.time, d.compared[d.time == contact.time, axis][0], "v", color="tab:red", mec="black", ms=7,
            mfc="tab:red" if crossed else "white", label=label,
        )  # fmt: skip
    axes.grid(alpha=0.3)


def _where(bound: FloatArray, d: Decisions) -> FloatArray:
    """Leave a threshold out where it detects nothing: before the window is full."""
    shown = bound.copy()
    shown[~d.armed] = float("nan")
    return shown
