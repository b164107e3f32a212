"""`make soak`: two hours, or as many minutes as are given, and a table of what was found."""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from fci.tests.soak.soak import AT_FIRST, FIRST_S, LOSS, MEMORY_GROWS, RESTS_S, Found, Soak


def table(found: Found) -> str:
    """Return what was found, for docs/results/shield.md."""
    ends = "\n".join(
        f"| {kind} | {count} | {_rest(found.rest_s.get(kind, []))} |" for kind, count in sorted(found.ends.items())
    )
    memory = "\n".join(f"| {name} | {first:.1f} | {last:.1f} |" for name, (first, last) in found.memory.items())
    troubles = "\n".join(f"- {trouble}" for trouble in found.troubles) or "None."
    return f"""# Soak

Made by `make soak`: `pretouch serve-fci` with sixteen units over UDP that loses {100 * LOSS:.0f} % each way, `pretouch
run` with a recording, and `pretouch live` with visitors, on one machine. Half of the time one run stays; then runs are
ended at random. Wall clocks step by up to a day, and the disk of the run that stays is full for a minute.

| | |
|---|---|
| time | {found.seconds / 60:.0f} min |
| recordings opened | {found.recordings}, {found.steps} control steps |
| visits of the page | {found.visits} |
| steps of the wall clock | {found.clock_steps} |
| largest joint speed | {100 * found.speed:.0f} % of its limit |
| motions ended by the arm: machine too busy, contact, other | {found.busy}, {found.reflexes}, {found.others} |

Rest: largest and median time from the end of a run in motion until the arm rests [s], up to 0.1 s too long; bound
{RESTS_S:g} s.

| ended by | runs | rest |
|---|---|---|
{ends}

Memory after the warm-up and at the end [MiB], by program and process; bound {100 * MEMORY_GROWS:.0f} % more,
or {100 * AT_FIRST:.0f} % in less than {FIRST_S / 60:.0f} min.

| process | first | last |
|---|---|---|
{memory}

## Troubles

{troubles}
"""


def _rest(times: list[float]) -> str:
    return f"{max(times):.2f}, {np.median(times):.2f}" if times else "-"


def main() -> int:
    """Soak and print the table; 1 if there was trouble."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = Soak(Path(folder), 60.0 * given.minutes, given.seed).run()
    print(table(found))
    return int(bool(found.troubles))


if __name__ == "__main__":
    sys.exit(main())
