"""Anything goes in, and what must hold holds: some steps by default, half a million in the slow suite."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz import weather
from tests.fuzz.machine import Machine

MODES = ("HOLD", "TRACK", "REACT")
EVENTS = (
    "UNUSABLE", "TIME_BACKWARDS", "STATE_STALE", "BLOCKED", "CONTACT", "REACTING", "YIELDING", "OPENING", "CLAMPED",
    "SKIN_SILENT", "NO_FORCE", "OVERRUN", "WINDOW_FILLING", "CLEAR",
)  # fmt: skip
"""Those that no seed lacks."""
EXPECTED = [
    *(f"mode {mode}" for mode in MODES),
    *(f"outcome {outcome}" for outcome in ("SOLVED", "INFEASIBLE", "SKIPPED")),
    *(f"event {event}" for event in EVENTS),
    *(f"sight {sight}" for sight in weather.SIGHTS),
    *(f"force {force}" for force in weather.FORCES),
    *(f"fault {fault}" for fault in weather.FAULTS),
    *(f"fault lie about {part}" for part in ("q", "qd", "q_commanded", "qd_commanded")),
    *(f"restriction {mode}" for mode in ("none", "paper hard", "paper slack", "paper floor", "braking")),
    *(f"units {units}" for units in (0, 1, 7, 32)),
    *(f"{what} {yes}" for what in ("slack", "slowed", "on the axis", "latched") for yes in (True, False)),
    "period 0.01", "period 0.001", "arm panda", "arm fr3",
]  # fmt: skip


@pytest.mark.parametrize("seed", [1001, pytest.param(1002, marks=pytest.mark.slow)])
def test_some_thousand_steps(seed: int):
    reached = Machine(seed).run(2_400, each=120)
    assert all(reached[f"mode {mode}"] > 100 for mode in MODES)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_half_a_million_steps(seed: int):
    reached = Machine(seed).run(50_000)
    missing = [name for name in EXPECTED if not reached[name]]
    assert not missing
    assert reached["step"] == 50_000
    assert min(reached[f"mode {mode}"] for mode in MODES) > 2_000


@pytest.mark.slow
def test_no_compiled_loop_leaves_its_arrays(tmp_path: Path):
    # compiled code does not look where it reads and writes, unless it is compiled to
    run = "from tests.fuzz.machine import Machine; Machine(2001).run(6_000, each=120)"
    checked = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", run], cwd=root, env=checked, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
