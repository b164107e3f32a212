import re
from pathlib import Path

from pretouch_lab.experiment import NAMES
from pretouch_lab.sweep import EXPERIMENTS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_paper_page_names_experiments_there_are():
    text = (DOCS / "explanation" / "paper.md").read_text()
    claims, weaknesses = (part.split("\n## ")[0] for part in text.split("\n## ")[1:3])
    named = [row.rstrip(" |").split(" | ")[-1] for row in claims.splitlines() if row.startswith("| ")]
    named += [row.split(" | ")[1] for row in weaknesses.splitlines() if row.startswith("| ")]
    found = set(re.findall(r"`([\w-]+)`", " ".join(named))) - {"reproduce"}
    assert len(found) == 4
    assert found <= set(NAMES)


def test_every_experiment_and_every_one_that_can_be_swept_is_described():
    text = (DOCS / "reference" / "experiments.md").read_text()
    assert [name for name in NAMES if f"**{name}**" not in text] == []
    text = (DOCS / "how-to" / "sweep.md").read_text()
    assert [name for name in EXPERIMENTS if f"`{name}`" not in text] == []
