"""Records in flat blocks: the same fields for Python and for compiled code."""

import sys
from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated, Literal, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pretouch.checks import Checked, Positive, PositiveCount
from pretouch.compiled import compiled
from pretouch.records import Blocks, Cell, Flat, opener
from pretouch.values import BoolArray, FloatArray, IntArray


class Pose(NamedTuple):
    place: Annotated[FloatArray, "n", 3]
    turned: float


class Body(NamedTuple):
    pose: Pose
    size: int
    on: Annotated[BoolArray, "n"]
    count: Annotated[IntArray, "k"]
    speed: Cell
    rows: Annotated[FloatArray, "k", "n"]


def body(n: int = 2, k: int = 3) -> Body:
    pose = Pose(np.arange(3.0 * n).reshape(n, 3), 0.5)
    return Body(pose, 7, np.arange(n) % 2 == 0, np.arange(k), np.full(1, 0.25), np.ones((k, n)))


_open = opener(Body, "pose", "size", "on", "count", "speed", "rows")


@compiled
def moved(blocks: Blocks, by: float) -> float:
    pose, size, on, count, speed, rows = _open(blocks)
    for i in range(len(pose.place)):
        pose.place[i, 2] += by * size if on[i] else 0.0
    count[0], speed[0] = len(rows), pose.turned
    return rows.sum()


@pytest.mark.parametrize(("n", "k"), [(2, 3), (1, 1), (4, 0), (0, 2)])
def test_what_is_laid_out_is_looked_up_and_written_by_its_path(n, k):
    given, flat = body(n, k), Flat.of(body(n, k))
    assert_array_equal(flat.get("pose.place"), given.pose.place)
    assert (flat.get("pose.turned"), flat.get("size"), flat.get("speed")) == (0.5, 7, 0.25)
    assert [len(block) for block in flat.blocks[:3]] == [3 * n + 2 + k * n, 1 + k, n]
    flat.put("rows", 2.0 * given.rows)
    flat.fill("pose", Pose(given.pose.place + 1.0, 3.0))
    part = flat.part("pose", Pose)
    assert_array_equal(part.place, given.pose.place + 1.0)
    assert float(part.turned) == 3.0
    part.place[:] = 9.0  # a view
    assert (flat.get("pose.place") == 9.0).all()
    assert_array_equal(flat.get("rows"), 2.0 * given.rows)
    assert_array_equal(flat.get("on"), given.on, strict=True)  # an array, be it of one


@pytest.mark.parametrize("wrong", [{"on": np.ones(3, bool)}, {"count": np.zeros(2, int)}, {"rows": np.ones(6)},
                                   {"speed": np.zeros(2)}, {"pose": Pose(np.zeros((2, 4)), 0.0)}])  # fmt: skip
def test_dimensions_that_differ_are_refused(wrong):
    with pytest.raises(ValueError, match="has the shape"):
        Flat.of(body()._replace(**wrong))


def test_compiled_code_reads_and_writes_fields_of_any_size_and_a_copy_leaves_the_original_as_it_is():
    for n, k in ((2, 3), (4, 1)):
        flat = Flat.of(body(n, k))
        copy = flat.copy()
        assert moved(copy.blocks, 2.0) == k * n
        assert_array_equal(copy.get("pose.place")[:, 2], body(n).pose.place[:, 2] + 14.0 * body(n).on)
        assert (copy.get("speed"), float(copy.part("pose", Pose).turned), copy.blocks[1][1]) == (0.5, 0.5, k)
        assert (flat.get("speed"), flat.get("pose.place")[0, 2]) == (0.25, 2.0)
    assert len(moved.signatures) == 1


@dataclass(frozen=True)
class Spring(Checked):
    stiffness: Positive = 100.0
    steps: PositiveCount = 3
    damped: bool = True
    colour: Literal["red", "blue"] = "red"
    rest_m: float | None = None


@compiled
def push(spring: Spring, way: float) -> float:
    return spring.stiffness * way * spring.steps if spring.damped else 0.0


def test_compiled_code_sees_the_plain_numbers_of_a_set_of_parameters():
    assert Spring.Numbers._fields == ("stiffness", "steps", "damped")
    assert push(Spring(stiffness=50).numbers, 0.1) == 15.0  # also where a whole number was given for a real one
    found = attrgetter(Spring.Numbers.__qualname__)(sys.modules[Spring.Numbers.__module__])
    assert found is Spring.Numbers  # Numba's cache keeps a class by its name
