"""The rows beside the documents give the numbers that the documents publish."""

import json
import lzma
from pathlib import Path
from statistics import median
from typing import Any

import pytest

RESULTS = Path(__file__).parents[2] / "docs/results"
COLUMNS = ("impact_speed_m_s", "detection_delay_s", "true_peak_20ms_n")


def lines(name: str) -> list[dict[str, Any]]:
    text = lzma.decompress((RESULTS / f"data/{name}.jsonl.xz").read_bytes()).decode()
    return [json.loads(line) for line in text.splitlines()]


@pytest.mark.parametrize("trajectory", ["circle", "line"])
@pytest.mark.parametrize("side", ["-y", "+y"])
@pytest.mark.parametrize("profile", ["blind", "paper"])
def test_trials_of_the_static_experiment_have_the_published_medians(profile: str, trajectory: str, side: str) -> None:
    place = {"experiment": "static", "profile": profile, "trajectory": trajectory, "side": side}
    place |= {"stiffness_n_per_m": 25_000.0, "restrictions": "off"}
    trials = [row for row in lines("edition-2-trials") if place.items() <= row.items()]
    assert sorted(row["seed"] for row in trials) == list(range(12))
    speed, delay, force = (median(row[column] for row in trials) for column in COLUMNS)
    table = lines("edition-2-tables")
    rows = [row for t in table if t["section"].startswith("Static object, 25 N/mm") for row in t["rows"]]
    (published,) = (row for row in rows if row[0] == f"{profile} {trajectory} {side}")
    shown = [published[column].split()[0] for column in (1, 2, 6)]
    assert [f"{speed:.3f}", f"{1000 * delay:.0f}", f"{force:.1f}"] == shown
