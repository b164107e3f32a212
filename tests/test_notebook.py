"""The notebook of the tutorial: run anew, it says what is stored in it."""

import re
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from tools.notebook import cells_of, outputs_of, page_of

NOTEBOOK = Path(__file__).parents[1] / "docs" / "tutorial" / "first-contact.ipynb"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def stored():
    return [cell["outputs"] for cell in cells_of(NOTEBOOK) if cell["cell_type"] == "code"]


def test_the_cells_run_and_say_what_is_stored(stored):
    made = outputs_of(cells_of(NOTEBOOK))
    assert [[output["output_type"] for output in outputs] for outputs in made] == [
        [output["output_type"] for output in outputs] for outputs in stored
    ]
    for new, old in zip(chain(*made), chain(*stored), strict=True):
        text, kept = ("".join(output.get("text") or output["data"]["text/plain"]) for output in (new, old))
        assert NUMBER.sub("#", text) == NUMBER.sub("#", kept)
        numbers = [np.array(NUMBER.findall(said), float) for said in (text, kept)]
        np.testing.assert_allclose(*numbers, rtol=0.02, atol=0.02)  # a processor may differ in the last digits


def test_what_is_stored_tells_of_slowing_a_touch_and_the_report(stored):
    told = "".join(line for output in chain(*stored) for line in output.get("text", []))
    for words in (
        "7 units",
        "bit for bit",
        "SLOWED",
        "TOUCHED",
        "YIELDING",
        "Contact at",
        "Joint limits exceeded: none",
    ):
        assert words in told
    assert NOTEBOOK.stat().st_size < 300_000


def test_a_page_has_its_cells_outputs_and_figures(tmp_path):
    page = page_of(NOTEBOOK, tmp_path / "first-contact.md")
    assert page.startswith("# From arm and skin to a contact and its report\n")
    assert page.count("```python\n") == page.count("```text\n") + 2  # a cell says nothing, another draws
    ((words, name),) = re.findall(r"!\[([^\]]+)\]\((\S+)\)", page)
    assert words.startswith("Distance")
    assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
