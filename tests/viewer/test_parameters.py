from dataclasses import fields, is_dataclass

import pytest

from pretouch.errors import ParameterError
from pretouch.params import PROFILES, Profile, profile
from pretouch.viewer.controls import named
from pretouch.viewer.parameters import TABLE_1, TableEntry, field_docs

TABLE_I = {
    "d_max": 0.8, "d_min": 0.05, "l_max": 200, "V_max": 0.04, "d_repulse": 0.1, "d_crit": 0.1, "d_notice": 0.6,
    "alpha": 0.1, "beta": -10, "lambda": 0.75, "F_std": 3, "F_d": 4, "F_b": 10, "sigma_max": 3,
}  # fmt: skip
"""Table I of the paper."""


def test_the_page_offers_table_i_with_the_papers_values() -> None:
    assert {entry.symbol: entry.read(PROFILES["paper"]) for entry in TABLE_1} == TABLE_I


@pytest.mark.parametrize("entry", TABLE_1, ids=lambda entry: entry.symbol)
def test_what_is_written_is_read_back_and_nothing_else_changes(entry: TableEntry) -> None:
    before = PROFILES["paper"]
    value = entry.read(before) * 1.05
    after = entry.write_text(before, f"{value:.9g}")
    assert entry.read(after) == pytest.approx(value)
    assert float(entry.text(after)) == pytest.approx(value)
    changed = {
        (group.name, field.name)
        for group in fields(Profile) if group.name != "name"
        if is_dataclass(getattr(before, group.name))
        for field in fields(getattr(before, group.name))
        if getattr(getattr(before, group.name), field.name) != getattr(getattr(after, group.name), field.name)
    }  # fmt: skip
    assert changed == set(entry.fields)


@pytest.mark.parametrize("entry", TABLE_1, ids=lambda entry: entry.symbol)
def test_each_has_a_hint_from_the_documentation(entry: TableEntry) -> None:
    assert "Table I" in entry.hint()


def test_a_value_that_is_not_allowed_is_refused_with_the_way_out() -> None:
    (d_crit,) = (entry for entry in TABLE_1 if entry.symbol == "d_crit")
    with pytest.raises(ParameterError, match=r"d_notice_m is 0\.6: it must be greater than d_crit_m, 0\.9"):
        d_crit.write(PROFILES["paper"], 0.9)


@pytest.mark.parametrize(
    ("symbol", "text", "said"),
    [
        ("l_max", "2.5", r"restore_cycles is 2\.5: it must be a whole number"),
        ("d_crit", "0,05", r"d_crit is '0,05': give a number such as 0\.1\."),
        ("F_b", "nan", "f_base_n is nan: it must be finite"),
    ],
)
def test_what_is_typed_and_is_no_such_number_is_refused(symbol: str, text: str, said: str) -> None:
    (entry,) = (entry for entry in TABLE_1 if entry.symbol == symbol)
    with pytest.raises(ParameterError, match=said):
        entry.write_text(PROFILES["paper"], text)


def test_the_documentation_of_every_parameter_is_found() -> None:
    for profile_field in fields(Profile):
        group = type(getattr(Profile(), profile_field.name))
        for field in fields(group) if is_dataclass(group) else ():
            assert any((owner.__name__, field.name) in field_docs() for owner in group.__mro__)


def test_a_changed_profile_is_named_so_that_it_can_be_found_again() -> None:
    (f_b,) = (entry for entry in TABLE_1 if entry.symbol == "F_b")
    (l_max,) = (entry for entry in TABLE_1 if entry.symbol == "l_max")
    changed = named(l_max.write(f_b.write(PROFILES["paper"], 8.5), 150), "paper")
    assert changed.name == "paper:task.restore_cycles=150:threshold.f_base_n=8.5"
    assert profile(changed.name) == changed
    fine = named(f_b.write(PROFILES["paper"], 8.12345678), "paper")
    assert profile(fine.name) == fine
    assert named(PROFILES["blind"], "blind") == PROFILES["blind"]


def test_what_a_profile_has_not_is_shown_as_nothing_and_cannot_be_set() -> None:
    (v_max,) = (entry for entry in TABLE_1 if entry.symbol == "V_max")
    assert v_max.text(PROFILES["blind"]) == ""
    with pytest.raises(ParameterError, match="V_max is a parameter of no part of this profile"):
        v_max.write(PROFILES["blind"], 0.1)
