"""`pretouch demo`, `reproduce` and `figure`: their docstrings are the help, and `reproducing` runs them."""

from dataclasses import dataclass, fields
from pathlib import Path

import tyro

from pretouch.cli.options import JsonFile
from pretouch_lab.options import Playing, TrialOptions


@dataclass(frozen=True)
class Demo:
    """Play a small part of the paper's three experiments with the profiles blind, paper and pretouch."""

    seeds: int = 4
    """Trials of each cell of the static experiment; the other two have one."""
    out: str = ""
    """Folder for rows, tables and figures; by default a new one under runs/."""
    json: JsonFile = None

    def run(self) -> None:
        """Play the trials, and write rows, tables and figures."""
        from pretouch_lab.cli.reproducing import demonstrate

        demonstrate(self.seeds, self.out, self.json)


@dataclass(frozen=True)
class Reproduce(Playing, TrialOptions):
    """Run the paper's experiments in full. The same options continue a run that was stopped."""

    experiment: tyro.conf.Positional[str] = "all"
    """static (paper IV-A), avoidance (IV-B), dynamic (IV-C), between (its close-up), a study, or all. All of them take
    about a quarter of an hour on two processors."""

    def run(self) -> None:
        """Run the experiments, and write rows, recordings, tables and figures."""
        from pretouch_lab.cli.reproducing import compared, reproduce, whole_paper
        from pretouch_lab.domain_randomisation import folder_part

        options = TrialOptions(**{each.name: getattr(self, each.name) for each in fields(TrialOptions)})
        parts = whole_paper(options) if self.experiment == "all" else compared(self.experiment, options)
        reproduce(parts, self.folder(f"reproduce-{self.experiment}{folder_part(self.world)}"), self)


@dataclass(frozen=True)
class Figure:
    """Play the trials of one figure of the paper, and draw it."""

    name: tyro.conf.Positional[str]
    """circle (Fig. 4), interaction (Fig. 5), close-up (Fig. 6) or force-difference (Fig. 7)."""
    out: str = ""
    """File to write, ending in .png, .pdf or .svg; by default NAME.png."""
    profile: str = "paper"
    """Profile to show."""
    seed: int = 0
    """Seed of the trials."""

    def run(self) -> None:
        """Draw the figure."""
        from pretouch_lab.cli.reproducing import draw_figure

        out = Path(self.out or f"{self.name}.png")
        draw_figure(self.name, out, self.profile, self.seed)
        print(f"Figure: {out}")
