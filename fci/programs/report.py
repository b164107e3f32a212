"""The tables of the results, for docs/results/programs.md."""

from pathlib import Path
from typing import Any

from pretouch.atomic_write import atomic_write
from pretouch.text_table import TextTable, markdown

BEGIN, END = "<!-- programs: generated, begin -->", "<!-- programs: generated, end -->"
"""Marks of a document, between which the tables stand."""


def into(document: Path, known: dict[str, Any], found: dict[str, Any]) -> None:
    """Replace what stands between the two marks of a Markdown document by the tables."""
    before, _, rest = document.read_text(encoding="utf-8").partition(BEGIN)
    _, mark, after = rest.partition(END)
    if not mark:
        raise SystemExit(f"{document} has no place for the tables: put {BEGIN} and {END} there.")
    tables = "\n".join(markdown(table, 2) for table in tables_of(known, found))
    atomic_write(document, f"{before}{BEGIN}\n\n{tables}\n{END}{after}")


def tables_of(known: dict[str, Any], found: dict[str, Any]) -> tuple[TextTable, TextTable]:
    """Make two tables with a server a column: how many programs of each set run, and which do not."""
    servers = [name for name in known["server"] if any(name in row for rows in found.values() for row in rows.values())]
    counts: list[tuple[str, ...]] = []
    failures: list[tuple[str, ...]] = []
    for title in (one["title"] for one in known["set"] if one["title"] in found):
        rows = found[title]
        counts.append((title, *(_count(rows, server) for server in servers)))
        failures += [
            (program, title.partition(",")[0], *verdicts)
            for program, row in rows.items()
            if set(verdicts := [row.get(server, {"verdict": "–"})["verdict"] for server in servers]) - {"runs", "–"}
        ]
    return (
        TextTable("How many run", ("set", *servers), tuple(counts), "Of those that were tried with that server."),
        TextTable("Which do not run", ("program", "of", *servers), tuple(failures), "All others run wherever tried."),
    )


def _count(rows: dict[str, Any], server: str) -> str:
    verdicts = [row[server]["verdict"] for row in rows.values() if server in row]
    return f"{verdicts.count('runs')} of {len(verdicts)}" if verdicts else "–"
