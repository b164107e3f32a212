"""What can be said to each benchmark that is published."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class BenchOptions:
    """Options of `pretouch bench detection`, `avoidance` and `both`."""

    quick: bool = False
    """A small part of it; it says what it cannot tell."""
    seeds: Literal["published", "development"] = "published"
    """Which simulated arms: those of the published tables, or others to develop with."""
    out: str = ""
    """Folder for results and figures; by default runs/bench or runs/bench-NAME, with -quick if it is."""
    docs: str = ""
    """Folder of documents (docs) whose benchmarks.md and images are to be made anew; by default none."""

    def folder(self, name: str) -> Path:
        """Where the results go; `name` is that under runs/."""
        return Path(self.out or f"runs/{name}{'-quick' if self.quick else ''}")

    @property
    def documents(self) -> Path | None:
        """Folder of documents to be made anew, if any."""
        return Path(self.docs) if self.docs else None
