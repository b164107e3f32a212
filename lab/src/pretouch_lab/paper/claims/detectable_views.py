"""The smallest forces detected as tables, and the fractions detected as a figure."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.experiment import Picture, Sources
from pretouch_lab.rows import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOTIONS = ("rest", "slow", "moving")
_RAMP_N_S = 30.0
"""The ramp of which the force at detection is shown [N/s]."""

Key = tuple[Any, ...]


def detectable_tables(part: Row) -> list[TextTable]:
    """Show the smallest pushes and steps detected, and the slowest ramps; of an interrupted run what there is."""
    cells = {_key(cell): cell for cell in part["cells"]}
    shapes = {cell["shape"] for cell in part["cells"]}
    made = [_forces(cells)] if shapes & {"push", "step"} else []
    return [*made, _ramps(cells)] if "ramp" in shapes else made


def _key(cell: Row) -> Key:
    return tuple(cell[name] for name in ("motion", "shape", "detector", "object", "direction"))


def _judges(cells: dict[Key, Row]) -> list[tuple[str, str]]:
    """Each detector with `near`, `far` or `any`, in the order of the experiment."""
    return list(dict.fromkeys((key[2], key[3]) for key in cells))


_NAMES = ("detector", lambda judge: judge[0]), ("object", lambda judge: judge[1])


def _forces(cells: dict[Key, Row]) -> TextTable:
    def smallest(motion: str, shape: str) -> Callable[[tuple[str, str]], str]:
        return lambda judge: _smallest(cells, motion, shape, judge)

    columns = (
        *_NAMES,
        *((f"{motion}\n{shape}", smallest(motion, shape)) for motion in _MOTIONS for shape in ("push", "step")),
        ("chance\n[%]", lambda judge: _by_chance(cells, judge)),
    )
    return tabulated(
        "Smallest push (0.2 s) and step (1 s) detected [N]: along an axis / along a diagonal",
        columns,
        _judges(cells),
        "Of the true force, the size from which on 9 of 10 events are detected, - if those of 30 N are not. Slow is"
        " 0.06 m/s, moving 0.3 m/s. Near: F_obs is 4 N on both sides, far: 0 N. Filtered (eq. 8), raw, and raw twice"
        " in a row are held against eq. 9 with F_b 10 N; fixed: the estimate itself against that force, no window."
        " Chance: how often a detector fires on the moving arm when nothing pushes it, in the 1.1 s in which it may"
        " detect a step; what often fires by chance tells nothing.",
    )


def _smallest(cells: dict[Key, Row], motion: str, shape: str, judge: tuple[str, str]) -> str:
    both = [cells.get((motion, shape, *judge, direction)) for direction in ("axis", "diagonal")]
    if None in both:
        return ""
    return " / ".join("-" if c["smallest_detected"] is None else f"{c['smallest_detected']:g}" for c in both if c)


def _by_chance(cells: dict[Key, Row], judge: tuple[str, str]) -> str:
    """Fraction [%] of the steps of no size on the moving arm at which a detector fires or was firing already."""
    both = [cells.get(("moving", "step", *judge, direction)) for direction in ("axis", "diagonal")]
    none = [entry for cell in both if cell for entry in cell["sizes"] if entry["size"] == 0.0]
    events = sum(entry["events"] for entry in none)
    return f"{100 * sum(entry['detected'] + entry['firing'] for entry in none) / events:.0f}" if events else ""


def _ramps(cells: dict[Key, Row]) -> TextTable:
    def smallest(motion: str) -> Callable[[tuple[str, str]], str]:
        return lambda judge: _smallest(cells, motion, "ramp", judge)

    def reached(motion: str) -> Callable[[tuple[str, str]], str]:
        return lambda judge: _reached(cells, motion, judge)

    columns = (
        *_NAMES,
        *(c for m in _MOTIONS for c in ((f"{m}\n[N/s]", smallest(m)), (f"{m}\n[N]", reached(m)))),
    )
    return tabulated(
        "Slowest ramp detected [N/s]: axis / diagonal; force when it is detected on an axis [N]",
        columns,
        _judges(cells),
        "A ramp rises to 30 N and is let go. Rate: the one from which on 9 of 10 ramps are detected before they are let"
        " go, - if those of 60 N/s are not. The mean of the window follows a slow ramp, so to all but the fixed"
        " thresholds it is never a contact, however large it grows; what fires by chance now and then seems to detect"
        f" the slowest ramps, which take long. Force: true force when a ramp of {_RAMP_N_S:g} N/s along an axis is"
        " detected: of each trial the median of those that are, and of the trials the median.",
    )


def _reached(cells: dict[Key, Row], motion: str, judge: tuple[str, str]) -> str:
    cell = cells.get((motion, "ramp", *judge, "axis"))
    reached = [entry["reached_n"] for entry in (cell["sizes"] if cell else []) if entry["size"] == _RAMP_N_S]
    return "" if not reached else "-" if reached[0] is None else f"{reached[0]['median']:.0f}"


_CURVES = (
    ("filtered", "near", "black", "-", "o"),
    ("filtered", "far", "black", "--", "o"),
    ("raw", "near", "tab:blue", "-", "^"),
    ("raw", "far", "tab:blue", "--", "^"),
    ("fixed 20 N", "any", "tab:red", ":", "s"),
)
_PANELS = (("push", "a push of 0.2 s"), ("step", "a step of 1 s")), (("rest", "at rest"), ("moving", "at 0.3 m/s"))


def draw_detectable(sources: Sources) -> list[Picture]:
    """Draw the fraction detected of pushes and steps along the axes against their size, at rest and moving."""
    from matplotlib.figure import Figure

    from pretouch_lab.paper.figures.marks import labels

    cells = {_key(cell): cell for cell in sources.summary["cells"]}
    shapes, motions = _PANELS
    if not any((motion, shape, *_CURVES[0][:2], "axis") in cells for shape, _ in shapes for motion, _ in motions):
        return []
    figure = Figure(figsize=(10, 6.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for row, (shape, what) in zip(panels, shapes, strict=True):
        for axes, (motion, how) in zip(row, motions, strict=True):
            _curves(axes, cells, motion, shape)
            axes.set_title(f"{what}, arm {how}")
            axes.grid(alpha=0.3)
    figure.legend(*labels(panels.ravel()), loc="outside lower center", ncols=len(_CURVES))
    for axes in panels[-1]:
        axes.set_xlabel("largest true force, along an axis [N]")
    for axes in panels[:, 0]:
        axes.set_ylabel("fraction detected")
    figure.suptitle("Pushes and steps detected, with an object near (F_obs 4 N) and far (0 N)")
    return [Picture("detectable", "Fraction of pushes and steps detected against their size", figure)]


def _curves(axes: "Axes", cells: dict[Key, Row], motion: str, shape: str) -> None:
    for detector, near, colour, style, marker in _CURVES:
        cell = cells.get((motion, shape, detector, near, "axis"))
        if cell:
            sizes, fractions = zip(*((entry["size"], entry["fraction"]) for entry in cell["sizes"]), strict=True)
            label = detector if near == "any" else f"{detector}, {near}"
            face = "none" if near == "far" else colour
            axes.plot(sizes, fractions, ls=style, marker=marker, ms=5, color=colour, mfc=face, label=label)
