"""Tables in a terminal: no word is lost, and no number is broken."""

import io

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pretouch.cli.tables import show
from pretouch.text_table import TextTable

WORDS = st.text("abcdefgh_ \n", max_size=60).map(str.strip)
NUMBERS = st.floats(-1e6, 1e6).map("{:.4g}".format) | st.sampled_from(["", "-", "0.123 ± 0.004", "1.2 (0.9 to 1.4)"])


@st.composite
def tables(draw):
    """Tables of some columns of words and some of numbers."""
    names, count, rows = (draw(st.integers(*limits)) for limits in ((0, 3), (1, 14), (0, 3)))
    header = tuple(draw(WORDS) for _ in range(names + count))
    cells = [(*(draw(WORDS) for _ in range(names)), *(draw(NUMBERS) for _ in range(count))) for _ in range(rows)]
    return TextTable("title", header, tuple(cells), "note", names)


def printed(table, width):
    out = io.StringIO()
    show(Console(file=out, width=width, highlight=False), [table])
    return out.getvalue()


@given(tables(), st.sampled_from([20, 80, 120]))
def test_every_number_is_shown_whole_and_every_word(table, width):
    said = printed(table, width)
    told = said.split()
    for word in sorted(word for row in table.rows for cell in row[table.names :] for word in cell.split()):
        told.remove(word)  # a ValueError where it is missing or broken
    words = "".join("".join((*table.header, *(cell for row in table.rows for cell in row))).split())
    assert sorted("".join(said.split())) == sorted(words + "titlenote")


def test_headings_are_wrapped_and_words_are_broken_for_numbers_to_stand_side_by_side():
    header, row = ("unit", "to the left [m]", "b"), ("forearm_on_the_left", "1.25", "3.75 ± 0.02")
    assert [line.rstrip() for line in printed(TextTable("title", header, (row,), "note", 1), 29).splitlines()] == [
        "", "title",
        "               to",
        "              the",
        "             left",
        "unit          [m]           b",
        "forearm_on_t 1.25 3.75 ± 0.02",
        "he_left",
        "note", "",
    ]  # fmt: skip
