"""The rows beside the documents give the numbers that the documents publish."""

import json
import lzma
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

RESULTS = Path(__file__).parents[2] / "docs/results"
COLUMNS = ("impact_speed_m_s", "detection_delay_s", "true_peak_20ms_n")


def lines(name: str) -> list[dict[str, Any]]:
    text = lzma.decompress((RESULTS / f"data/{name}.jsonl.xz").read_bytes()).decode()
    return [json.loads(line) for line in text.splitlines()]


def test_trials_of_the_static_experiment_have_the_published_medians() -> None:
    every, tables = lines("edition-2-trials"), lines("edition-2-tables")
    rows = [row for t in tables if t["section"].startswith("Static object, 25 N/mm") for row in t["rows"]]
    published = {row[0]: row for row in rows}
    for profile, trajectory, side in product(("blind", "paper"), ("circle", "line"), ("-y", "+y")):
        place = {"experiment": "static", "profile": profile, "trajectory": trajectory, "side": side}
        place |= {"stiffness_n_per_m": 25_000.0, "restrictions": "off"}
        trials = [row for row in every if place.items() <= row.items()]
        assert sorted(row["seed"] for row in trials) == list(range(12))
        speed, delay, force = (median(row[column] for row in trials) for column in COLUMNS)
        shown = [published[f"{profile} {trajectory} {side}"][column].split()[0] for column in (1, 2, 6)]
        assert [f"{speed:.3f}", f"{1000 * delay:.0f}", f"{force:.1f}"] == shown
