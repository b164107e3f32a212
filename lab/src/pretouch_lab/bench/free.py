"""Free motion: arms that nothing touches, some with somebody near, recorded once (`scenarios/free.toml`)."""

from dataclasses import dataclass

import numpy as np

from pretouch.types import FloatArray
from pretouch_lab.bench.scenes import SeedRange, numbered, path_of, plant_of, scenario, sensing_of
from pretouch_lab.bench.streams import AWAY, Alone, Prepare, Stream, record

_HAND_SIDE_M = 0.102
"""How far the arm's hand reaches out to the side of its origin [m]."""
_HAND_FRONT_M = 0.13
"""How far hand and wrist reach out to the front [m]."""


@dataclass(frozen=True)
class FreeCell:
    """One arm on one path."""

    kind: str
    path: str
    speed_m_s: float
    near: str
    """nothing, standing or passing."""
    seed: int
    counted_s: float
    """Time that counts [s], after the warm-up."""
    world: str = ""
    """Set of the domain randomisation of which the seed draws one, or none."""

    @property
    def name(self) -> str:
        """Name for files."""
        return f"{self.kind}_{self.path}_{self.speed_m_s:g}_{self.near}_{self.seed:04d}"


def free_cells(seeds: SeedRange, quick: bool) -> list[FreeCell]:
    """Return the cells of the scenario file."""
    family = scenario("free")
    counted = float(family["duration"]["quick_s" if quick else "full_s"])
    return [
        FreeCell(arm["kind"], arm["path"], arm["speed_m_s"], arm["near"], seed, counted)
        for arm, seed in numbered(family, family["arm"], seeds, quick)
    ]


def warm_up_s() -> float:
    """Return the time in which no alarm counts [s]."""
    return float(scenario("free")["duration"]["warm_up_s"])


def free_stream(cell: FreeCell) -> Stream:
    """Let an arm move that nothing touches, with the skin of seven units where somebody is near; return its stream."""
    what = Alone(
        path_of(cell.path), cell.speed_m_s, plant_of(cell.kind),
        None if cell.near == "nothing" else sensing_of("seven", cell.seed), scenario("free")["near"]["radius_m"],
        cell.seed, warm_up_s() + cell.counted_s, cell.world,
    )  # fmt: skip
    return record(what, _bystander(cell))


def _bystander(cell: FreeCell) -> Prepare:
    """Return what has somebody stand beside the path, or come and go there; the seed says where."""
    near, rng = scenario("free")["near"], np.random.default_rng([cell.seed, 31])
    closest = rng.uniform(*near["gap_m"])
    side, off = rng.choice([-1.0, 1.0]), rng.uniform(-0.1, 0.1, 2)

    def place(gap_m: float) -> FloatArray:
        if cell.path == "line":
            return np.array([0.4 + _HAND_FRONT_M + gap_m + near["radius_m"], 2 * off[0], 0.5 + 0.5 * off[1]])
        out = side if cell.path == "circle" else 1.0
        return np.array([0.5 + off[0], out * (0.25 + _HAND_SIDE_M + gap_m + near["radius_m"]), 0.25 + off[1]])

    way = near["passing_from_m"] - closest
    there_s = way / near["passing_speed_m_s"]
    cycle_s = near["passing_wait_s"] + 2 * there_s

    def passing(time: float) -> FloatArray:
        since = time % cycle_s - near["passing_wait_s"]
        if since < 0:
            return AWAY
        part = since / there_s if since < there_s else 2.0 - since / there_s
        return place(near["passing_from_m"] - part * way)

    standing = AWAY if cell.near == "nothing" else place(closest)
    return lambda plant: passing if cell.near == "passing" else standing
