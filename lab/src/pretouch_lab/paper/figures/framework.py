"""Diagram of the framework as this package builds it (paper, Fig. framework)."""

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch


@dataclass(frozen=True)
class Block:
    """One box of the diagram."""

    name: str
    where: tuple[float, float]
    """Its centre, in units of the drawing."""
    steps: tuple[tuple[str, str], ...]
    """What it does, and the function of `pretouch` that does it: module and name."""


@dataclass(frozen=True)
class Flow:
    """One arrow of the diagram, from a point to another, and what flows along it."""

    start: tuple[float, float]
    end: tuple[float, float]
    type: str
    """Module of `pretouch` and name, or nothing where it is a plain number or array."""
    words: str
    label: tuple[float, float]
    """Where type and words are written."""


_WIDTH, _HEIGHT = 4.4, 1.9

BLOCKS = (
    Block(
        "Perception",
        (2.6, 5.6),
        (
            ("eq. 1: where it is", "perception.obstacles.locate"),
            ("arm and room left out", "perception.scene_filter.expected_range"),
            ("points kept 60 ms", "perception.obstacles.track"),
            ("closest body points", "perception.closest.closest_points"),
        ),
    ),
    Block(
        "Avoidance",
        (8.6, 5.6),
        (
            ("eq. 3: slower", "control.reduction.speed_scale"),
            ("eq. 4: back to speed", "control.reduction.reduce_speed"),
            ("eqs. 5-7: limits", "control.restriction.approach_limit"),
            ("as rows of the QP", "control.restriction.approach_rows"),
        ),
    ),
    Block(
        "Contact",
        (2.6, 2.6),
        (
            ("eq. 8: window", "contact.window.add_force"),
            ("eqs. 9-10: thresholds", "contact.thresholds.thresholds"),
            ("eq. 11: anticipation", "contact.thresholds.obstacle_force"),
            ("crossed: contact", "contact.moving_thresholds.MovingThresholds"),
        ),
    ),
    Block(
        "Modes and reaction",
        (8.6, 2.6),
        (
            ("TRACK, REACT, HOLD", "modes.next_mode"),
            ("the path, by its phase", "control.path.follow"),
            ("eq. 12: with the push", "contact.decaying_velocity.reaction_velocity"),
            ("its linear decay", "contact.decaying_velocity.decayed"),
        ),
    ),
    Block(
        "Quadratic program",
        (14.4, 4.1),
        (
            ("eq. 2: cost", "control.qp.task_cost"),
            ("joint limits", "control.joint_box.joint_box"),
            ("joint velocities", "control.qp.solve"),
            ("or brake", "control.joint_box.brake"),
        ),
    ),
)

FLOWS = (
    Flow((2.6, 7.6), (2.6, 6.55), "types.RangeReadings", "", (2.7, 7.1)),
    Flow((2.6, 0.6), (2.6, 1.65), "types.RobotState", "posture (to all blocks), force estimate", (2.7, 0.7)),
    Flow((4.8, 5.6), (6.4, 5.6), "types.Obstacles", "", (5.05, 5.7)),
    Flow((2.6, 4.65), (2.6, 3.55), "types.Obstacles", "", (2.7, 4.0)),
    Flow((4.8, 2.6), (6.4, 2.6), "types.Contact", "", (5.15, 2.7)),
    Flow((8.6, 4.65), (8.6, 3.55), "", "speed factor", (8.7, 4.0)),
    Flow((10.8, 5.6), (12.2, 4.7), "control.restriction.ApproachRows", "G qd <= h", (11.0, 5.55)),
    Flow((10.8, 2.6), (12.2, 3.5), "types.Mode", "and velocity", (11.5, 2.6)),
    Flow((14.4, 3.15), (14.4, 0.6), "types.QpSolution", "joint velocities, to the arm", (14.5, 1.6)),
    Flow((14.4, 5.05), (14.4, 7.0), "types.ControlStep", "all that was seen and decided", (14.5, 6.0)),
)


def framework_figure() -> Figure:
    """Blocks with the equation and the function behind each of their steps, and the types that flow between them."""
    figure = Figure(figsize=(14.5, 6.4), layout="constrained")
    axes: Axes = figure.subplots()
    axes.set(xlim=(0.3, 17.6), ylim=(0.5, 7.7))
    axes.set_axis_off()
    for block in BLOCKS:
        _draw_block(axes, block)
    for flow in FLOWS:
        axes.annotate("", flow.end, flow.start, arrowprops={"arrowstyle": "-|>", "lw": 1.6, "color": "black"})
        said = [flow.type.rsplit(".", 1)[-1], flow.words]
        axes.text(*flow.label, "\n".join(filter(None, said)), fontsize=9.5, style="italic", va="bottom")
    axes.set_title("One control step (controller.Controller.step): from readings to joint velocities")
    return figure


def _draw_block(axes: Axes, block: Block) -> None:
    x, y = block.where
    left, low = x - _WIDTH / 2, y - _HEIGHT / 2
    axes.add_patch(
        FancyBboxPatch((left, low), _WIDTH, _HEIGHT, "round,pad=0,rounding_size=0.12", fc="0.95", ec="black")
    )
    axes.text(x, low + _HEIGHT - 0.12, block.name, fontsize=12, weight="bold", ha="center", va="top")
    for i, (what, function) in enumerate(block.steps):
        height = low + _HEIGHT - 0.62 - 0.36 * i
        axes.text(left + 0.1, height, what, fontsize=8.5, va="center")
        axes.text(
            x + _WIDTH / 2 - 0.1,
            height,
            ".".join(function.split(".")[-2:]),
            fontsize=8,
            family="monospace",
            ha="right",
            va="center",
        )
