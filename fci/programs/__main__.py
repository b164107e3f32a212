"""Other people's programs, unchanged, against simulated Franka arms: which run, and why the others do not.

    unshare --net --mount sh -c '
        ip link set lo up
        mount -t tmpfs none /sys/kernel && echo 1 > /sys/kernel/realtime
        exec python -m fci.programs --server pretouch --place franky=/path/to/environment ...'

Without `--place` for all names of a set, that set is left out. What runs, and where: programs.toml.
"""

import argparse
import json
import sys
import tomllib
from dataclasses import asdict
from pathlib import Path
from string import Formatter
from typing import Any

from fci.programs import report
from fci.programs.playing import HOST, play, programs_of

from pretouch.atomic_write import write_json

_LIST = Path(__file__).with_name("programs.toml")
_DOCUMENT = Path(__file__).parents[2] / "docs" / "results" / "programs.md"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m fci.programs", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--server", help="a server of programs.toml; without one, only --docs does something")
    parser.add_argument("--place", action="append", default=[], metavar="NAME=FOLDER", help="where programs are")
    parser.add_argument("--only", default="", metavar="TEXT", help="only programs with this in set and name")
    parser.add_argument("--limit", type=float, default=120.0, help="how long one may take [s]")
    parser.add_argument("--json", type=Path, default=Path("programs.json"), metavar="FILE", help="results of all runs")
    parser.add_argument("--docs", action="store_true", help="write all results into docs/results/programs.md")
    return parser.parse_args()


def _names(command: str) -> set[str]:
    """Return the names in braces of a command line."""
    return {name for _, name, _, _ in Formatter().parse(command) if name}


def main() -> int:
    """Run what can be run, and keep the results with those of earlier runs."""
    args = _arguments()
    known: dict[str, Any] = tomllib.loads(_LIST.read_text(encoding="utf-8"))
    found: dict[str, Any] = json.loads(args.json.read_text(encoding="utf-8")) if args.json.is_file() else {}
    if args.server:
        if args.server not in known["server"]:
            raise SystemExit(f"--server {args.server}: give one of {', '.join(known['server'])}.")
        places = dict(pair.partition("=")[::2] for pair in args.place)
        _run(known, args, places | {"host": HOST, "here": str(Path(sys.executable).parent)}, found)
    if args.docs:
        report.into(_DOCUMENT, known, found)
    return 0


def _run(known: dict[str, Any], args: argparse.Namespace, places: dict[str, str], found: dict[str, Any]) -> None:
    server = known["server"][args.server]
    for one in known["set"]:
        if one["robot"] not in server["robots"]:
            continue
        for program in programs_of(one):
            if args.only not in f"{one['title']} {program.name}":
                continue
            if missing := _names(program.command) - {*places, "robot"}:
                print(f"Left out: {one['title']}. Give --place {' and '.join(sorted(missing))}.")
                break
            words = f"{server['command']} {server.get(program.beside, '')}"
            played = play(program, words, places | {"robot": one["robot"]}, args.limit)
            print(f"{played.verdict:12} {played.seconds:6.1f} s  {program.name}  {played.why}", flush=True)
            found.setdefault(one["title"], {}).setdefault(program.name, {})[args.server] = asdict(played)
            write_json(found, args.json)


if __name__ == "__main__":
    sys.exit(main())
