"""A flood of 100 000 datagrams a second, with real processes (benchmarks/skin_receiver.py)."""

import os
from pathlib import Path

import numpy as np
import pytest

from pretouch.hardware.keys import Keys, UnitKey, new_key

_TRIES = 4


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.parametrize("kind", ["random", "forged", "replayed", "mixed"])
def test_under_a_flood_less_than_a_hundredth_is_lost_and_nothing_is_20_ms_late(kind, monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "benchmarks")
    from skin_receiver import FLOOD, measure

    keys = Keys(UnitKey(f"unit {n}", n, new_key()) for n in range(1, 21))
    priority = 10 if os.geteuid() == 0 else None
    # a machine that is busy elsewhere may lack the processor for flooder and receiver: that is not the receiver's fault
    for _ in range(_TRIES):
        seen = measure(3.0, keys, kind, priority)
        flooded = seen.flooded > 0.95 * FLOOD
        if flooded and seen.lost < 0.01 and np.max(seen.lateness) < 0.02:
            return
    if not flooded:
        pytest.skip(f"this machine sends only {seen.flooded:.0f} datagrams a second")
    pytest.fail(f"{100 * seen.lost:.2f} % lost, {1e3 * np.max(seen.lateness):.1f} ms late")
