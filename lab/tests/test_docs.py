import re
from pathlib import Path

from pretouch_lab.registry import EXPERIMENTS

ROOT = Path(__file__).parents[2]


def test_the_paper_page_names_experiments_there_are():
    text = (ROOT / "docs" / "explanation" / "paper.md").read_text()
    claims, weaknesses = (part.split("\n## ")[0] for part in text.split("\n## ")[1:3])
    named = [row.rstrip(" |").split(" | ")[-1] for row in claims.splitlines() if row.startswith("| ")]
    named += [row.split(" | ")[1] for row in weaknesses.splitlines() if row.startswith("| ")]
    found = set(re.findall(r"`([\w-]+)`", " ".join(named))) - {"reproduce"}
    assert len(found) == 7
    assert found <= set(EXPERIMENTS)


def test_every_experiment_is_described():
    text = (ROOT / "docs" / "reference" / "experiments.md").read_text()
    assert [name for name in EXPERIMENTS if f"**{name}**" not in text] == []
