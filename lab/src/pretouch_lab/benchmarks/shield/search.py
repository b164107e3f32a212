"""A commander that learns to hit hard: the cross-entropy method over its parameters, on the trials it has seen."""

from pathlib import Path

import numpy as np

from pretouch.atomic_write import write_json
from pretouch_lab.benchmarks.scenario_files import SeedRange
from pretouch_lab.benchmarks.shield.commanders import GENES, Attack
from pretouch_lab.benchmarks.shield.trial import TouchCell, tried
from pretouch_lab.rows import Row

_ELITE = 0.3
"""Share of a generation that the next one is drawn about."""
_LEAST_SPREAD = 0.05
"""Standard deviation that it keeps at least: a search that has converged learns nothing more."""


def learned(
    filter_name: str, scene: str, generations: int, size: int, seeds: SeedRange = "published", first: int = 0
) -> list[Row]:  # fmt: skip
    """Play generations of so many trials; each trial has another person, from seed number `first` on.

    What is maximised is the speed of the fastest touch of a trial, seen or not; without one, less the least distance.
    """
    rng = np.random.default_rng([first, 32])
    mean, spread, rows = np.full(GENES, 0.5), np.full(GENES, 0.35), []
    for generation in range(generations):
        drawn = np.clip(mean + spread * rng.normal(size=(size, GENES)), 0.0, 1.0)
        worth = np.empty(size)
        for i, genes in enumerate(drawn):
            number = first + generation * size + i
            row = tried(TouchCell(filter_name, "learned", scene, number, seeds, Attack(*genes.tolist())))
            speeds = [touch["speed_m_s"] for touch in row["touches"]]
            worth[i] = max(speeds, default=-row["least_distance_m"])
            rows.append({**row, "generation": generation, "attack": [round(gene, 3) for gene in genes.tolist()]})
        best = drawn[np.argsort(worth)[-max(2, round(_ELITE * size)) :]]
        mean, spread = best.mean(axis=0), np.maximum(best.std(axis=0), _LEAST_SPREAD)
    return rows


def keep_learned(
    filter_name: str, scene: str, generations: int, size: int, seeds: SeedRange, file: Path
) -> None:  # fmt: skip
    """Search, and write all trials to a file."""
    rows = learned(filter_name, scene, generations, size, seeds)
    write_json({"part": "touch", "filter": filter_name, "commander": "learned", "trials": rows}, file)


def keep_trials(
    filter_name: str, commander: str, scene: str, numbers: tuple[int, int], seeds: SeedRange, file: Path
) -> None:  # fmt: skip
    """Play the trials of some seeds, by their numbers from and to, and write them to a file."""
    rows = [tried(TouchCell(filter_name, commander, scene, number, seeds)) for number in range(*numbers)]
    write_json({"part": "touch", "filter": filter_name, "commander": commander, "trials": rows}, file)
