"""What can be said to each benchmark that is published."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pretouch.errors import ExperimentError


@dataclass(frozen=True)
class BenchOptions:
    """Options of `pretouch bench detection`, `avoidance` and `both`."""

    quick: bool = False
    """A small part of it; it says what it cannot tell."""
    seeds: Literal["published", "development"] = "published"
    """Which simulated arms: those of the published tables, or others to develop with."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the arms of the published tables. Results of a world are kept in a folder of its own."""
    out: str = ""
    """Folder for results and figures; by default runs/bench or runs/bench-NAME, with -quick if it is."""
    docs: str = ""
    """Folder of documents (docs) whose results/benchmarks.md and images are to be made anew; by default none."""

    def folder(self, name: str) -> Path:
        """Where the results go; `name` is that under runs/."""
        from pretouch_lab.worlds import folder_part

        return Path(self.out or f"runs/{name}{folder_part(self.world)}{'-quick' if self.quick else ''}")

    @property
    def documents(self) -> Path | None:
        """Folder of documents to be made anew, if any."""
        if self.docs:
            self.check_published("--docs")
        return Path(self.docs) if self.docs else None

    def check_published(self, option: str) -> None:
        """Refuse to write numbers of another world where the published ones stand."""
        if self.world:
            raise ExperimentError(
                f"The world is {self.world!r}, and {option} writes the published tables, which are of the usual one:"
                f" leave out {option}; tables and figures are in the run's folder."
            )
