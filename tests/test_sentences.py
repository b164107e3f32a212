"""Sentences are for people: with every one of them changed, all numbers stay, and so does all that is read off them."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from pretouch import modes
from pretouch.explanation import explain, resumable
from pretouch.types import ControlStep
from tests.golden.fields import values_of
from tests.golden.streams import STREAMS, controller

SENTENCES = {"reason", "qp.status"}
"""Fields that hold one."""


def changed() -> tuple[modes.Transition, ...]:
    """The table with other sentences, which say what another one's began with."""
    words = ["Clamped; resume: {}", "Moving with a contact: violated {}", "{}"]
    return tuple(replace(row, sentence=words[i % 3]) for i, row in enumerate(modes.TABLE))


def steps_of(name: str) -> Iterator[ControlStep]:
    """All steps of an input by script, from its beginning."""
    stream = STREAMS[name]
    line, script = controller(stream), stream.script()
    state = line.init(script.state(0))
    for i in range(len(script.time)):
        step, state = line.step(state, script.inputs(i))
        yield step


@pytest.mark.parametrize("name", ["clamp", "faults/paper", "faults/pretouch", "release/paper", "blocked/hard"])
def test_nothing_is_decided_by_a_sentence(name: str, monkeypatch: pytest.MonkeyPatch):
    usual = list(steps_of(name))
    monkeypatch.setattr(modes, "TABLE", changed())
    line = controller(STREAMS[name])
    names = line.skin.ids, line.model.links
    for before, now in zip(usual, steps_of(name), strict=True):
        one, other = (
            {field: value for field, value in values_of(step).items() if field not in SENTENCES}
            for step in (before, now)
        )
        for field, value in one.items():
            assert np.array_equal(value, other[field], equal_nan=value is not None and value.dtype.kind == "f"), field
        now = replace(now, qp=replace(now.qp, status="an approach row is violated"))
        assert now.limited == before.limited
        assert resumable(now) == resumable(before)
        assert explain(now, *names).doing is explain(before, *names).doing
    assert any(step.reason != old.reason for step, old in zip(steps_of(name), usual, strict=True))
