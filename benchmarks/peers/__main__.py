"""Pretouch against mink, pink and NEO, on the same problem in one run.

    python -m benchmarks.peers --set-up                 # install the peers into environments of their own, and measure
    python -m benchmarks.peers --json results.json
    python -m benchmarks.peers --python mink=/path/to/python

What is compared, and how it is checked that it is the same problem, stands in docs/explanation/peers.md.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.peers import measuring, report
from benchmarks.peers.environments import PEERS, ROOT, python_of, set_up
from benchmarks.peers.ours import panda_arm
from benchmarks.peers.problem import generate


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--set-up", action="store_true", help="install peers that are missing, under .venv/peers")
    parser.add_argument("--python", action="append", default=[], metavar="PEER=PATH",
                        help="interpreter of an environment that has mink, pink or neo")  # fmt: skip
    parser.add_argument("--points", type=int, nargs="+", default=[0, 7, 32, 128, 1000], help="obstacle points K")
    parser.add_argument("--snapshots", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=20, help="how often every contender has its turn")
    parser.add_argument("--budget", type=float, default=0.1, help="CPU time of one turn [s]")
    parser.add_argument("--runs", type=int, default=1, help="repeat the whole measurement, with new processes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to a file")
    parser.add_argument("--docs", action="store_true", help="put the first table into docs/explanation/peers.md")
    return parser.parse_args()


def _named(pairs: list[str]) -> dict[str, str]:
    """Interpreters by peer, as they were named on the command line."""
    named = dict(pair.partition("=")[::2] for pair in pairs)
    known = [peer.extra for peer in PEERS]
    for extra, python in named.items():
        if extra not in known or not Path(python).is_file():
            raise SystemExit(
                f"--python {extra}={python}: give one of {', '.join(known)}, and an interpreter that exists."
            )
    return named


def main() -> int:
    """Find the peers, pose the problem, compare, show; 1 if two answers to the same problem differ."""
    args = _arguments()
    named = _named(args.python)
    if args.set_up:
        for peer in PEERS:
            if peer.extra not in named:
                set_up(peer)
    pythons = {f"{peer.extra}_peer": python for peer in PEERS if (python := python_of(peer, named))}
    missing = [peer.extra for peer in PEERS if f"{peer.extra}_peer" not in pythons]
    if missing:
        print(f"Not installed: {', '.join(missing)}. To install: python -m benchmarks.peers --set-up")
    if not pythons:
        print("There is no peer to compare with.")
        return 0
    plan = measuring.Plan(tuple(args.points), args.snapshots, args.rounds, args.snapshots, args.budget)
    found = _measured(plan, {"ours": sys.executable} | pythons, args.runs, args.seed)
    report.show(found)
    for text in found["disagreements"]:
        print(text)
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if args.docs:
        report.into(ROOT / "docs" / "explanation" / "peers.md", found)
    return 1 if found["disagreements"] else 0


def _measured(plan: measuring.Plan, pythons: dict[str, str], runs: int, seed: int) -> dict[str, Any]:
    """All runs of the comparison, as one value for JSON."""
    text = f"{plan.snapshots} snapshots, {plan.rounds} rounds of blocks of at most {plan.budget:g} s, seed {seed}."
    found: dict[str, Any] = {"machine": report.machine(), "plan": text, "versions": {}, "runs": [], "disagreements": []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arm, q_ready = panda_arm()
        for points in plan.points:
            generate(arm, q_ready, plan.snapshots, points, seed).save(folder / f"{points}.npz")
        for _ in range(runs):
            with measuring.workers(pythons, folder) as started:
                asked: dict[str, measuring.Worker] = {}
                for worker in started:
                    about = worker.ask("about")
                    found["versions"][worker.module.removesuffix("_peer")] = about["versions"]
                    asked |= dict.fromkeys(about["contenders"], worker)
                results = measuring.compare(plan, asked, folder)
            found["runs"].append([r.summary(results[measuring.REFERENCE, k]) for (_, k), r in results.items()])
            found["disagreements"] += measuring.disagreements(results)
    return found


if __name__ == "__main__":
    sys.exit(main())
