"""How many words of the documents are written by hand."""

import re
from pathlib import Path

_GENERATED = re.compile(r"<!-- ([\w-]+): generated, begin -->.*?<!-- \1: generated, end -->", re.DOTALL)


def words_by_hand(root: Path) -> dict[Path, int]:
    """Count the words of each document that is written by hand.

    Documents are README.md, CONTRIBUTING.md where there is one, and all Markdown files below docs but those in
    docs/results. What stands between the marks of a generated part is not counted. Words are what white space
    separates.

    Args:
        root: folder of the repository.

    Returns:
        Number of words by path, relative to the root.
    """
    results = root / "docs" / "results"
    documents = [path for name in ("README.md", "CONTRIBUTING.md") if (path := root / name).exists()]
    documents += [path for path in sorted((root / "docs").rglob("*.md")) if not path.is_relative_to(results)]
    return {
        path.relative_to(root): len(_GENERATED.sub("", path.read_text(encoding="utf-8")).split()) for path in documents
    }
