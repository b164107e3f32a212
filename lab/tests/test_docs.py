import re
from pathlib import Path

from pretouch_lab.experiment import NAMES
from pretouch_lab.sweep import EXPERIMENTS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_paper_page_names_experiments_there_are():
    text = (DOCS / "explanation" / "paper.md").read_text()
    names = set(re.findall(r"\(`([\w-]+)`[,)]", text))
    assert len(names) == 4
    assert names <= set(NAMES)


def test_every_experiment_and_every_one_that_can_be_swept_is_described():
    text = (DOCS / "reference" / "experiments.md").read_text()
    assert [name for name in NAMES if f"**{name}**" not in text] == []
    text = (DOCS / "how-to" / "sweep.md").read_text()
    assert [name for name in EXPERIMENTS if f"`{name}`" not in text] == []
