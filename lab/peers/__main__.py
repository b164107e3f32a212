"""Pretouch, mink and pink on the same problem, one after the other in one run.

    python -m lab.peers --set-up               # installs the peers under .venv/peers, and measures
    python -m lab.peers --json results.json

Each peer runs in an environment and a process of its own, without Pretouch. The program names peers that are not
installed, and leaves them out. docs/explanation/peers.md describes the problem and the check that all peers solve it.
"""

import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from lab.peers.pretouch_peer import panda_arm
from lab.peers.problem import generate
from rich.console import Console

from pretouch.cli.tables import show
from pretouch.text_table import TextTable
from pretouch_lab.bench.cycle import processor

ROOT = Path(__file__).resolve().parents[2]
PEERS = ("mink", "pink")
REFERENCE = "ours, rows"
SNAPSHOTS, BUDGET_S, SEED = 300, 0.1, 0
"""Snapshots of a problem, CPU time of one block of a contender [s], and seed of the problems."""
TOLERANCE = 1e-6
"""Largest difference of two answers to the same problem [rad/s]."""
_FOR_P999 = 1000
"""Least number of samples for a p99.9."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
Row = dict[str, Any]


def python_of(peer: str) -> Path:
    """Return the interpreter of a peer's environment."""
    return ROOT / ".venv" / "peers" / peer / "bin" / "python"


def set_up(peer: str) -> None:
    """Create an environment for a peer, if it has none, without Pretouch, so that no versions can clash."""
    folder = python_of(peer).parents[1]
    if folder.exists():
        return
    print(f"Installing {peer} into {folder}", flush=True)
    try:
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)  # noqa: S603, our own arguments
        needs = Path(__file__).with_name(f"{peer}.txt")
        subprocess.run([python_of(peer), "-m", "pip", "install", "--quiet", "-r", needs], check=True)  # noqa: S603
    except BaseException:
        shutil.rmtree(folder)  # an incomplete environment must not remain
        raise


class Worker:
    """A process with the contenders of one environment."""

    def __init__(self, peer: str, process: "subprocess.Popen[str]") -> None:
        self.peer, self.process = peer, process
        about = self.ask("about")
        self.versions, self.contenders = about["versions"], about["contenders"]

    def ask(self, do: str, **arguments: object) -> Any:
        """Send a request and return its answer."""
        try:
            self.process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
            self.process.stdin.flush()
            return json.loads(self.process.stdout.readline())
        except (BrokenPipeError, json.JSONDecodeError):
            raise SystemExit(f"The process of {self.peer} ended: see its message above.") from None


@contextmanager
def worker(peer: str, python: str, folder: Path) -> Iterator[Worker]:
    """Start the worker of a peer on one thread; terminate it at the end of the block."""
    command = [python, "-m", "lab.peers.worker", peer, str(folder)]
    environment = os.environ | dict.fromkeys(_THREADS, "1")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=ROOT, env=environment, **pipes) as process:  # noqa: S603, our own arguments
        try:
            yield Worker(peer, process)
        finally:
            process.terminate()


def compare(points: list[int], rounds: int, workers: dict[str, Worker], folder: Path) -> list[Row]:
    """Compare the answers to the rows' problem, then measure round robin in short blocks, so that drift affects all."""
    differences = {(name, k): _difference(name, k, workers, folder) for k in points for name in workers}
    blocks: dict[tuple[str, int], list[list[int]]] = {key: [] for key in differences}
    for turn in range(rounds):
        for k in points:
            for name in list(workers) if turn % 2 == 0 else list(workers)[::-1]:
                block = {"name": name, "points": k, "start": turn * SNAPSHOTS // rounds, "budget_s": BUDGET_S}
                blocks[name, k].append(workers[name].ask("block", **block))
        print(f"round {turn + 1} of {rounds}", file=sys.stderr, end="\r", flush=True)
    return [figures(*key, difference, blocks) for key, difference in differences.items()]


def _difference(name: str, points: int, workers: dict[str, Worker], folder: Path) -> float | None:
    """Return the largest difference from our answer over all snapshots [rad/s]; None for another problem."""
    if not name.endswith("rows"):
        return None
    file = folder / f"{points} {name}.npy"
    workers[name].ask("answers", name=name, points=points, file=str(file))
    return float(np.abs(np.load(file) - np.load(folder / f"{points} {REFERENCE}.npy")).max())


def figures(name: str, points: int, difference: float | None, blocks: dict[tuple[str, int], list[list[int]]]) -> Row:
    """Return the row of a contender; `ratio` is the median over the rounds of its median over ours."""
    every = np.concatenate(blocks[name, points]) / 1e3
    medians, ours = ([statistics.median(block) for block in blocks[each, points]] for each in (name, REFERENCE))
    return {
        "contender": name,
        "points": points,
        "samples": len(every),
        "median_us": float(np.median(every)),
        "p999_us": float(np.percentile(every, 99.9)) if len(every) >= _FOR_P999 else None,
        "max_us": float(every.max()),
        "ratio": statistics.median(own / our for own, our in zip(medians, ours, strict=True)),
        "difference_rad_s": difference,
    }


def tables(rows: list[Row], note: str) -> list[TextTable]:
    """Return tables of times and ratios, with a line for each contender and a column for each number of points."""
    points, names = (list(dict.fromkeys(row[key] for row in rows)) for key in ("points", "contender"))
    by_cell = {(row["contender"], row["points"]): row for row in rows}

    def grid(title: str, *keys: str, below: str = "") -> TextTable:
        cells = ((name, *(_cell(by_cell[name, k], keys) for k in points)) for name in names)
        return TextTable(title, ("", *(f"K = {k}" for k in points)), tuple(cells), below)

    return [
        grid("CPU time, median / p99.9 [us]", "median_us", "p999_us", below=note),
        grid("CPU time as a multiple of ours, rows", "ratio"),
    ]


def _cell(row: Row, keys: tuple[str, ...]) -> str:
    return " / ".join(
        "-" if row[key] is None else f"{row[key]:.3g}" if row[key] < 1e3 else f"{row[key]:.0f}" for key in keys
    )


def main() -> int:
    """Install peers with --set-up, compare them, and print the tables; return 1 if answers to one problem differ."""
    parser = argparse.ArgumentParser(prog="python -m lab.peers", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--set-up", action="store_true", help="install missing peers under .venv/peers")
    parser.add_argument("--points", type=int, nargs="+", default=[0, 7, 32, 128, 1000], help="obstacle points K")
    parser.add_argument("--rounds", type=int, default=20, help="number of blocks of each contender")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to a file")
    args = parser.parse_args()
    for peer in PEERS if args.set_up else ():
        set_up(peer)
    pythons = {"pretouch": sys.executable} | {p: str(python_of(p)) for p in PEERS if python_of(p).exists()}
    if missing := [peer for peer in PEERS if peer not in pythons]:
        print(f"Not installed: {', '.join(missing)}. To install: python -m lab.peers --set-up")
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder, (arm, q_ready) = Path(name), panda_arm()
        for k in args.points:
            generate(arm, q_ready, SNAPSHOTS, k, SEED).save(folder / f"{k}.npz")
        workers = [stack.enter_context(worker(peer, python, folder)) for peer, python in pythons.items()]
        rows = compare(args.points, args.rounds, {name: each for each in workers for name in each.contenders}, folder)
    machine = f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    about = {"machine": machine, "rounds": args.rounds, "versions": {each.peer: each.versions for each in workers}}
    show(Console(), tables(rows, f"{machine}; {SNAPSHOTS} snapshots, {args.rounds} rounds. {about['versions']}"))
    if args.json:
        args.json.write_text(json.dumps({"about": about, "rows": rows}, indent=1) + "\n", encoding="utf-8")
    failures = [row for row in rows if row["difference_rad_s"] is not None and not row["difference_rad_s"] <= TOLERANCE]
    for row in failures:
        print(f"{row['contender']} at {row['points']} points differs by {row['difference_rad_s']:.1e} rad/s.")
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
