import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.errors import ExperimentError
from pretouch_lab.sweep.parameters import dimension


@pytest.mark.parametrize(
    ("text", "now", "values"),
    [
        ("2:20:4", 1.0, [2.0, 8.0, 14.0, 20.0]),
        ("1:100:log:3", 1.0, [1.0, 10.0, 100.0]),
        ("1:64:log:7:int", 3, [1, 2, 4, 8, 16, 32, 64]),
        ("1:3:9", 3, [1, 2, 3]),
        ("4,2, 8", 1.0, [4.0, 2.0, 8.0]),
        ("slack,floor", "off", ["slack", "floor"]),
        ("yes,no", False, [True, False]),
        ("7", 1, [7]),
    ],
)
def test_a_grid_takes_these_values(text, now, values):
    grid = dimension("a.b", text, now).grid()
    assert grid == pytest.approx(values) if isinstance(values[0], float) else grid == values
    assert [type(v) for v in grid] == [type(v) for v in values]


@pytest.mark.parametrize(
    ("text", "now", "words"),
    [
        ("", 1.0, "a.b= is empty: write NAME=LOW:HIGH"),
        ("20:2", 1.0, "goes from 20 to 2: give the lower one first"),
        ("0:2:log", 1.0, "begins at 0: begin above 0"),
        ("1:2:lag", 1.0, "ends in 'lag': write"),
        ("1:2:1", 1.0, "ends in '1': write"),
        ("1:b", 1.0, "a.b is 'b': write a number"),
        ("1:nan", 1.0, "a.b is nan: write a finite number"),
        ("1:2.5", 3, "a.b is '2.5': write a whole number"),
        ("1:2:int", 1.0, "whole numbers, and a.b is none"),
        ("1,1", 1.0, "names a value twice"),
        ("a:b", "off", "not one of numbers: a.b is 'off'"),
        ("maybe", True, "a.b is 'maybe': write yes or no"),
    ],
)
def test_a_range_that_cannot_be_read_is_said_with_the_way_out(text, now, words):
    with pytest.raises(ExperimentError, match=words.replace("(", r"\(")):
        dimension("a.b", text, now)


@given(part=st.floats(0.0, 1.0), log=st.booleans(), whole=st.booleans())
def test_every_part_of_a_range_lies_in_it(part, log, whole):
    one = dimension("a.b", "1:64:log" if log else "1:64", 1 if whole else 1.0)
    assert 1 <= one.at(part) <= 64
    assert isinstance(one.at(part), int) == whole
    assert (one.at(0.0), one.at(1.0)) == (1, 64)


def test_each_choice_and_each_whole_number_has_as_much_of_the_range():
    parts = [(i + 0.5) / 600 for i in range(600)]
    choices, whole = dimension("a.b", "x,y,z", "x"), dimension("a.b", "1:4", 1)
    assert [sum(choices.at(p) == v for p in parts) for v in "xyz"] == [200, 200, 200]
    assert [sum(whole.at(p) == v for p in parts) for v in (1, 2, 3, 4)] == [150, 150, 150, 150]


def test_the_middle_of_a_logarithmic_range_is_its_geometric_mean():
    assert dimension("a.b", "0.01:1:log", 1.0).at(0.5) == pytest.approx(0.1)
