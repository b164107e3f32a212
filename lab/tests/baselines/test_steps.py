"""What the baselines do with inputs by script is what it did, and whatever goes in, what must hold holds."""

from pathlib import Path

import pytest
from tests.fuzz import worlds
from tests.fuzz.machine import Machine
from tests.golden.kept import close, first_difference, read, write
from tests.golden.streams import Stream, course, run
from tests.golden.values import selected

from pretouch.decision import Decision

FILE = Path(__file__).with_name("values.npz")
"""Renewed by `python -m lab.tests.baselines.test_steps`, where a baseline is meant to do something else."""
REACHED = {
    "fixed": ("track", "react"), "observer": ("track", "react"),
    "flacco": ("track", "react"), "ding": ("track", "react", "restricted"),
}  # fmt: skip


@pytest.mark.parametrize("name", REACHED)
def test_steps_are_the_stored_ones(name: str) -> None:
    stored, steps = read(FILE)[f"course/{name}"], run(Stream(name, course, REACHED[name]))
    here = {i: steps[i] for i in stored}
    assert not first_difference({name: stored}, {name: here}, close, ("values.npz", "this checkout"))


@pytest.mark.parametrize("name", ["flacco", "ding"])
def test_a_step_in_one_call_is_the_one_that_python_decides(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Stream(name, course, REACHED[name])
    fast = run(stream)
    monkeypatch.setattr(Decision, "_is_compiled", lambda *_: False)
    assert not first_difference({name: run(stream)}, {name: fast}, close, ("decided", "in one call"))


def test_some_thousand_steps_of_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worlds, "BASES", tuple(REACHED))
    monkeypatch.setattr(worlds, "USUAL", (1.0,))
    assert Machine(1003).run(2_400, each=120)["mode TRACK"] > 100


if __name__ == "__main__":
    write(FILE, {f"course/{name}": selected(run(Stream(name, course, REACHED[name]))) for name in REACHED})
