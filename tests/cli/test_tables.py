"""Tables in a terminal, that of `pretouch skin monitor` too: no word is lost, and no number is broken."""

import io
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pretouch.cli.skin_monitor import table
from pretouch.cli.tables import show
from pretouch.text_table import TextTable
from pretouch.types import RangeStatus
from pretouch.units.health import unit_health
from tests.units.traffic import BEFORE, NOW, heard, traffic

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


def unit(state="live", **changes):
    """A unit with the widest numbers there are."""
    widest = unit_health(heard(), NOW, traffic(id="hand_right", state=state, bound=0.01234), BEFORE)
    return replace(widest, latency_s=0.1042, loss=1.0, temperature_c=-20.1, **changes)


def shown(*units):
    console = Console(file=io.StringIO(), width=80)
    console.print(table(units, []))
    return console.file.getvalue()


@pytest.mark.parametrize("state", ["live", "greeting", "never heard", "silent"])
def test_nothing_is_cut_off_in_a_terminal_of_80_columns(state):
    said = shown(unit(state), unit(status=RangeStatus.OUT_OF_BOUNDS), unit(unit="a_unit_with_a_long_name"))
    assert "\N{HORIZONTAL ELLIPSIS}" not in said
    for word in ("rate", "latency", "dist.", "sigma", "batt.", "temp.", "IMU", "clock", "OUT_OF_BOUNDS", "-20.1"):
        assert word in said
    assert max(map(len, said.splitlines())) <= 80


def test_a_unit_that_is_live_shows_what_its_newest_reading_is_and_others_their_state():
    assert " OK " in shown(unit())
    assert " live " in shown(unit(statuses={}))
    assert " greeting " in shown(unit("greeting"))
    assert " OK " not in shown(unit("silent"))
    stuck = unit()
    assert " STUCK " in shown(replace(stuck, traffic=replace(stuck.traffic, stuck=True)))
