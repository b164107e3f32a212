"""The table of `pretouch skin monitor`."""

from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from pretouch.cli.skin_table import table
from pretouch.hardware.health import Counts, UnitStatus, unit_health
from pretouch.types import RangeStatus
from tests.hardware.traffic import NOW, heard, traffic


def unit(state="live", **changes):
    """A unit with the widest numbers there are."""
    made = unit_health("hand_right", heard(), NOW, UnitStatus.of(traffic()), Counts(500))
    standing = replace(made.standing, state=state, bound=0.01234)
    return replace(made, latency_s=0.1042, loss=1.0, temperature_c=-20.1, standing=standing, **changes)


def shown(*units):
    console = Console(file=StringIO(), width=80)
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
    assert " STUCK " in shown(replace(stuck, standing=replace(stuck.standing, stuck=True)))
