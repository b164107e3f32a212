"""Limits of body regions."""

from pretouch.reporting.orientation import REGIONS


def test_transient_figures_are_twice_the_others_where_there_are_any():
    assert all(region.transient in (None, 2 * region.quasi_static) for region in REGIONS)
    assert [r.name for r in REGIONS if r.transient is None] == ["Skull and forehead", "Face"]
