"""The board of the paper's static experiment, met by each detector in the closed loop (`scenarios/static.toml`)."""

from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from pretouch.atomic_write import write_json
from pretouch.sensing.skin import paper_skin
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch_lab.baselines.detection import Baseline
from pretouch_lab.benchmarks.detection.arm import Sensing, model, sensing_of
from pretouch_lab.benchmarks.scenario_files import SeedRange, scenario, seed_of
from pretouch_lab.paper import static
from pretouch_lab.rows import rounded
from pretouch_lab.trial import Record, Setup, play

COST_S = 1.0
"""Processor time of a trial, about [s]."""


@dataclass(frozen=True)
class BoardCell:
    """One arm, one path, one board."""

    trajectory: str
    side: str
    stiffness_n_per_m: float
    sensing: str
    seed: int
    world: str = ""
    """Set of the domain randomisation of which the seed draws one, or none."""

    @property
    def name(self) -> str:
        """Name for files."""
        side = "plus" if self.side == "+y" else "minus"
        return f"{self.trajectory}_{side}_{self.stiffness_n_per_m:g}_{self.sensing}_{self.seed:04d}"


def board_cells(seeds: SeedRange, quick: bool) -> list[BoardCell]:
    """Return the cells of the scenario file; each place of a board has the same seeds."""
    family, amount = scenario("static"), "quick" if quick else "full"
    board, variants = family["board"], family["variants"]
    places = product(board["trajectories"], board["sides"], board["stiffness_n_per_m"])
    cells = [
        BoardCell(*place, "nominal", seed_of(family, seeds, i))
        for place in places
        for i in range(family["seeds_of_a_cell"][amount])
    ]
    return cells + [
        BoardCell("circle", side, board["stiffness_n_per_m"][0], sensing, seed_of(family, seeds, i))
        for sensing, side in product(variants["sensing"], board["sides"])
        for i in range(variants[amount])
    ]


def meet_board(cell: BoardCell, baseline: Baseline, file: Path) -> None:
    """Run one trial and keep its row."""
    sensing, found = _seven(cell), baseline.profile
    setup = Setup(
        model=model(),
        skin=sensing.skin,
        believed=None if sensing.believed is sensing.skin else sensing.believed,
        profile=replace(found, approach=None),
        scene=static_scene(cell.trajectory, cell.side, cell.stiffness_n_per_m, cell.seed),
        path=static_path(cell.trajectory, cell.side),
        seed=cell.seed,
        world=cell.world,
        ranging=sensing.ranging,
    )
    record = play(setup, static.done_after_contact())
    push = -1.0 if cell.side == "+y" else 1.0
    row = {
        **{name: value for name, value in asdict(cell).items() if name != "world" or value},
        "contender": baseline.name,
        **static.results(record, push, model().links),
        "clamping_n": clamping_n(record),
    }
    write_json(row, file)


def _seven(cell: BoardCell) -> Sensing:
    """Return a cell's sensing with the skin of the paper's experiment."""
    if cell.sensing == "nominal":
        return sensing_of("seven", cell.seed)
    return sensing_of(cell.sensing, cell.seed, paper_skin(model()))


def clamping_n(record: Record) -> float | None:
    """Mean true force [N] some time after the touch, the board being where it was; None if it ended before."""
    span, touch = scenario("static")["clamping"], record.first_contact()
    if touch is None or record.true_time[-1] < touch + span["to_s"]:
        return None
    during = (record.true_time >= touch + span["from_s"]) & (record.true_time < touch + span["to_s"])
    return rounded(float(np.linalg.norm(record.true_force[during], axis=1).mean()))
