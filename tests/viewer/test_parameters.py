from dataclasses import fields

import pytest

from pretouch.composition import leaves
from pretouch.errors import ParameterError
from pretouch.profiles import PROFILES, Profile, profile
from pretouch.viewer.controls import with_name
from pretouch.viewer.parameters import TABLE_1, TableEntry, field_docs, groups_of

TABLE_I = {
    "d_max": 0.8, "d_min": 0.05, "l_max": 200, "V_max": 0.04, "d_repulse": 0.1, "d_crit": 0.1, "d_notice": 0.6,
    "alpha": 0.1, "beta": -10, "lambda": 0.75, "F_std": 3, "F_d": 4, "F_b": 10, "sigma_max": 3,
}  # fmt: skip
"""Table I of the paper."""


def read(entry: TableEntry, found: Profile) -> float:
    return float(entry.text(found))


def test_the_page_offers_table_i_with_the_papers_values() -> None:
    assert {entry.symbol: read(entry, PROFILES["paper"]) for entry in TABLE_1} == TABLE_I


@pytest.mark.parametrize("entry", TABLE_1, ids=lambda entry: entry.symbol)
def test_what_is_written_is_read_back_and_nothing_else_changes(entry: TableEntry) -> None:
    before = PROFILES["paper"]
    value = read(entry, before) * 1.05
    after = entry.write_text(before, f"{value:.9g}")
    assert read(entry, after) == pytest.approx(value)
    one, other = dict(leaves(before)), dict(leaves(after))
    assert {path for path in one if one[path] != other[path]} == set(entry.paths)


def test_a_profile_without_the_part_shows_nothing_and_says_so() -> None:
    (f_b,) = (entry for entry in TABLE_1 if entry.symbol == "F_b")
    assert f_b.text(PROFILES["pretouch"]) == ""
    with pytest.raises(ParameterError, match="F_b is no parameter of this profile"):
        f_b.write_text(PROFILES["pretouch"], "9")


@pytest.mark.parametrize("entry", TABLE_1, ids=lambda entry: entry.symbol)
def test_each_has_a_hint_from_the_documentation(entry: TableEntry) -> None:
    assert "Table I" in entry.hint()


def test_a_value_that_is_not_allowed_is_refused_with_the_way_out() -> None:
    (d_crit,) = (entry for entry in TABLE_1 if entry.symbol == "d_crit")
    with pytest.raises(ParameterError, match=r"d_notice_m is 0\.6: it must be greater than d_crit_m, 0\.9"):
        d_crit.write_text(PROFILES["paper"], "0.9")


@pytest.mark.parametrize(
    ("symbol", "text", "said"),
    [
        ("l_max", "2.5", r"restore_cycles is '2\.5': write a whole number"),
        ("d_crit", "0,05", r"d_crit is '0,05': give a number such as 0\.1\."),
        ("F_b", "nan", "f_base_n is nan: it must be finite"),
    ],
)
def test_what_is_typed_and_is_no_such_number_is_refused(symbol: str, text: str, said: str) -> None:
    (entry,) = (entry for entry in TABLE_1 if entry.symbol == symbol)
    with pytest.raises(ParameterError, match=said):
        entry.write_text(PROFILES["paper"], text)


def test_the_documentation_of_every_parameter_is_found() -> None:
    for group in (group for known in PROFILES.values() for group in groups_of(known)):
        for field in fields(group):
            assert field_docs()[type(group).__name__, field.name]


def test_a_changed_profile_is_named_so_that_it_can_be_found_again() -> None:
    (f_b,) = (entry for entry in TABLE_1 if entry.symbol == "F_b")
    (l_max,) = (entry for entry in TABLE_1 if entry.symbol == "l_max")
    changed = with_name(l_max.write_text(f_b.write_text(PROFILES["paper"], "8.5"), "150"), "paper")
    assert changed.name == "paper:task.restore_cycles=150:detect.f_base_n=8.5"
    assert profile(changed.name) == changed
    fine = with_name(f_b.write_text(PROFILES["paper"], "8.12345678"), "paper")
    assert profile(fine.name) == fine
    assert with_name(PROFILES["blind"], "blind") == PROFILES["blind"]
