"""Tables of the results for the terminal, and the first of them for docs/explanation/peers.md."""

import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

_BEGIN, _END = "<!-- peers: generated, begin -->", "<!-- peers: generated, end -->"


def machine() -> str:
    """Name the processor and what runs on it."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{names[0] if names else platform.processor()}, {len(names)} cores, Python {platform.python_version()}"


def _us(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.1f}" if value < 100 else f"{value:,.0f}".replace(",", " ")


def _cell(row: dict[str, Any]) -> str:
    return f"{_us(row['median_us'])} / {_us(row['p999_us'])}"


def _ratio(row: dict[str, Any]) -> str:
    return f"{row['ratio']:.2g}" if row["ratio"] < 10 else f"{row['ratio']:.0f}"


def _grid(rows: list[dict[str, Any]], show: Any) -> tuple[list[str], list[list[str]]]:
    """Header and body of a table with a contender a line and a number of points a column."""
    points = sorted({row["points"] for row in rows})
    found = {(row["contender"], row["points"]): row for row in rows}
    names = list(dict.fromkeys(row["contender"] for row in rows))
    head = ["", *(f"K = {k}" for k in points)]
    return head, [[name, *(show(found[name, k]) for k in points)] for name in names]


_TABLES = (
    ("CPU time, median / p99.9 [us]", _cell, lambda row: True),
    ("CPU time as a multiple of ours, rows", _ratio, lambda row: True),
)
"""Title, what a cell shows, and which rows it is for: a table for each run."""
_CHECKS = (
    ("Largest difference from our joint velocities [rad/s]", lambda row: f"{row['difference_rad_s']:.0e}",
     lambda row: row["difference_rad_s"] is not None),
    ("Solves without an answer", lambda row: f"{row['unsolved']} of {row['samples']}", lambda row: row["unsolved"]),
)  # fmt: skip
"""The same, for the last run only: the answers do not depend on the time they take."""


def _tables(report: dict[str, Any]) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Title, header and body of each table; contenders without anything to show are left out."""
    runs = report["runs"]
    titled = [
        (f"{title}, run {n}", rows, cell, wanted) for title, cell, wanted in _TABLES for n, rows in enumerate(runs, 1)
    ]
    titled += [(title, runs[-1], cell, wanted) for title, cell, wanted in _CHECKS]
    for title, rows, cell, wanted in titled:
        names = {row["contender"] for row in rows if wanted(row)}
        if names:
            yield title, *_grid([row for row in rows if row["contender"] in names], cell)


def show(report: dict[str, Any]) -> None:
    """Print all tables."""
    console = Console()
    for title, head, body in _tables(report):
        table = Table(title=escape(title), title_justify="left")
        for column in head:
            table.add_column(column, justify="left" if column == "" else "right")
        for line in body:
            table.add_row(*line)
        console.print(table)


def into(document: Path, report: dict[str, Any]) -> None:
    """Replace what stands between the two marks of a Markdown document by the first table."""
    before, _, rest = document.read_text(encoding="utf-8").partition(_BEGIN)
    _, found, after = rest.partition(_END)
    if not found:
        raise SystemExit(f"{document} has no place for the table: put {_BEGIN} and {_END} there.")
    document.write_text(f"{before}{_BEGIN}\n{_markdown(report)}\n{_END}{after}", encoding="utf-8")


def _markdown(report: dict[str, Any]) -> str:
    parts = [f"Measured on: {report['machine']}. {report['plan']}"]
    title, head, body = next(_tables(report))
    rule = ["---", *["---:"] * (len(head) - 1)]
    lines = ["| " + " | ".join(line) + " |" for line in (head, rule, *body)]
    parts.append(f"**{title}**\n\n" + "\n".join(lines))
    versions = "\n".join(
        f"- {module}: " + ", ".join(f"{name} {number}" for name, number in found.items())
        for module, found in report["versions"].items()
    )
    return "\n\n".join([*parts, f"**Versions**\n\n{versions}"])
