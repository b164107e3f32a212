"""The table of the results, for docs/results/programs.md."""

from pathlib import Path
from typing import Any

from pretouch.atomic_write import atomic_write
from pretouch.text_table import TextTable, markdown

BEGIN, END = "<!-- programs: generated, begin -->", "<!-- programs: generated, end -->"
"""Marks of a document, between which the tables stand."""


def into(document: Path, known: dict[str, Any], found: dict[str, Any]) -> None:
    """Replace what stands between the two marks of a Markdown document by a table for each set."""
    before, _, rest = document.read_text(encoding="utf-8").partition(BEGIN)
    _, mark, after = rest.partition(END)
    if not mark:
        raise SystemExit(f"{document} has no place for the tables: put {BEGIN} and {END} there.")
    tables = "\n".join(markdown(table, 3) for table in tables_of(known, found))
    atomic_write(document, f"{before}{BEGIN}\n\n{tables}\n{END}{after}")


def tables_of(known: dict[str, Any], found: dict[str, Any]) -> list[TextTable]:
    """Make a table of each set that was run: a program a row, a server a column, and below it how many run."""
    made = []
    for one in known["set"]:
        rows = found.get(one["title"], {})
        servers = [name for name in known["server"] if any(name in row for row in rows.values())]
        if servers:
            body = tuple((name, *(_cell(row.get(server)) for server in servers)) for name, row in rows.items())
            counts = (f"{server} {_count(rows, server)}" for server in servers)
            made.append(
                TextTable(one["title"], ("program", *servers), body, f"Of {len(rows)} run: {', '.join(counts)}.")
            )
    return made


def _cell(played: dict[str, Any] | None) -> str:
    if played is None:
        return "–"
    return played["verdict"] if played["verdict"] == "runs" else f"{played['verdict']}: {played['why']}"


def _count(rows: dict[str, Any], server: str) -> int:
    return sum(row.get(server, {}).get("verdict") == "runs" for row in rows.values())
