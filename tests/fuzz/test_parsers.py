"""No damaged file and no message is worse than a sentence, soon: what is whole is changed at random."""

import time
import tracemalloc
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz.mutations import Change, changed, changes
from tests.fuzz.parsers import Parser, parsers

SOON_S = 10.0
"""Longest time for anything that is read [s]."""
MEMORY = 400_000_000
"""Largest memory that Python and NumPy may take for it [B]."""
NAMES = (
    "recording", "recording of units", "CSV of forces", "CSV of torques", "ROS bag", "URDF", "skin", "keys",
    "world", "learnt", "description", "profile", "wire",
)  # fmt: skip


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Parser]]:
    with parsers(tmp_path_factory.mktemp("parsers")) as found:
        assert set(found) == set(NAMES)
        yield found


def read(parser: Parser, data: bytes) -> bool:
    """Have it read; return whether it was refused."""
    try:
        parser.read(data)
        sentence = ""
    except parser.allowed as refused:
        sentence = str(refused) or type(refused).__name__
    assert len(sentence) < 2000 + len(data)
    return bool(sentence)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_whole_is_read_and_what_once_did_harm_does_none(there: dict[str, Parser], name: str) -> None:
    parser = there[name]
    assert not read(parser, parser.corpus[0])
    for data in parser.corpus[1:]:
        tracemalloc.start()
        began = time.monotonic()
        read(parser, data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < MEMORY
        assert time.monotonic() - began < SOON_S


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_whatever_is_changed_is_no_worse_than_a_sentence(there: dict[str, Parser], name: str) -> None:
    parser = there[name]

    @settings(max_examples=200, deadline=1e3 * SOON_S, suppress_health_check=list(HealthCheck))
    @given(changes, changes)
    def fuzzed(first: list[Change], second: list[Change]) -> None:
        data = parser.corpus[second[0].number % len(parser.corpus)]
        read(parser, changed(data, first, (*parser.words, parser.corpus[0][:200])))

    fuzzed()
