"""`make soak`: two hours, or as many minutes as are given, and a table."""

import argparse
import sys
import tempfile
from pathlib import Path

from fci.tests.soak.soak import Soak
from fci.tests.soak.table import table


def main() -> int:
    """Soak and print the table; 1 if there was trouble."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--docs", type=Path, help="folder of documents whose results/soak.md is made anew")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = Soak(Path(folder), 60.0 * given.minutes, given.seed).run()
    text = table(found)
    print(text)
    if given.docs:
        (given.docs / "results" / "soak.md").write_text(text)
    return int(bool(found.troubles))


if __name__ == "__main__":
    sys.exit(main())
