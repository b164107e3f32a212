"""The part of a document that a run of the localisation benchmark writes."""

from pathlib import Path

from pretouch.text_table import markdown
from pretouch_lab.benchmarks.documents import put
from pretouch_lab.benchmarks.localization.campaign import NAME
from pretouch_lab.benchmarks.localization.results import tables_of
from pretouch_lab.benchmarks.store import Row

DOCUMENT = "results/localization.md"
"""In a folder of documents."""


def publish(results: Row, docs: Path) -> Path:
    """Write the tables between the marks of the document, and return which it is."""
    about = results["about"]
    said = f"Version {about['version']}, {about['seeds']} seeds, {'quick' if about['quick'] else 'full'} run."
    put(docs / DOCUMENT, NAME, "\n\n".join([said, *map(markdown, tables_of(results))]))
    return docs / DOCUMENT
