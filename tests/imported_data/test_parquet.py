"""Tables in Parquet files."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from pretouch.imported_data.parquet import read_parquet


def test_of_a_column_of_long_lists_only_the_first_places_are_columns(tmp_path: Path) -> None:
    place = tmp_path / "a.parquet"
    parquet.write_table(pa.table({"q": pa.array([np.zeros(100_000)])}), place)
    assert len(read_parquet(place)[0]) == 64


def test_nanoseconds_since_1970_are_numbers(tmp_path: Path) -> None:
    place, now = tmp_path / "a.parquet", 1_700_000_000_123_456_789
    parquet.write_table(pa.table({"time_ns": np.array([now, now + 10**7])}), place)
    _, numbers = read_parquet(place)
    assert np.diff(numbers([0])[:, 0])[0] == pytest.approx(1e7, abs=512)
