"""Tables in a terminal: none is wider than it, and no number is lost or broken."""

import io

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pretouch.cli.tables import Grid, show
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


def printed(table, width, **options):
    out = io.StringIO()
    console = Console(file=out, width=width, highlight=False)
    console.print(Grid(table.header, table.rows, table.names, range(table.names), **options))
    return out.getvalue()


@given(tables(), st.integers(20, 120))
def test_no_line_is_wider_than_the_terminal(table, width):
    out = io.StringIO()
    show(Console(file=out, width=width), [table])
    assert max(map(len, out.getvalue().splitlines())) <= width


@given(tables(), st.sampled_from([80, 100, 120]), st.integers(0, 3))
def test_every_number_is_shown_whole(table, width, broken):
    said = printed(table, width, broken=min(broken, table.names))
    shown = sorted(word for row in table.rows for cell in row[table.names :] for word in cell.split())
    told = said.split()
    for word in shown:
        told.remove(word)  # a ValueError where it is missing or broken


def test_what_does_not_fit_stands_below_beside_the_names_again():
    table = TextTable("", ("arm", *(f"number {i}" for i in range(4))), (("left", *("1.25 ± 0.01",) * 4),), "", 1)
    assert printed(table, 40).splitlines() == [
        "arm     number 0    number 1    number 2",
        "left 1.25 ± 0.01 1.25 ± 0.01 1.25 ± 0.01",
        "",
        "arm     number 3",
        "left 1.25 ± 0.01",
    ]


def test_a_name_that_may_be_broken_lets_the_numbers_stand_side_by_side():
    table = TextTable("", ("unit", "a", "b"), (("forearm_on_the_left", "1.25 ± 0.01", "3.75 ± 0.02"),), "", 1)
    assert printed(table, 34, broken=1).splitlines() == [
        "unit                 a           b",
        "forearm_on 1.25 ± 0.01 3.75 ± 0.02",
        "_the_left                         ",
    ]
