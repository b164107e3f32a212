"""`pretouch demo`, `reproduce` and `figure`: their docstrings are the help."""

from dataclasses import dataclass
from itertools import count
from pathlib import Path

import tyro

from pretouch.cli.options import Numbers, Words

_DEMONSTRATED = ("blind", "paper", "pretouch")


@dataclass(frozen=True)
class Demo:
    """Play a small part of the paper's three experiments: blind, as the paper, and as we do it, side by side."""

    seeds: int = 4
    """Trials of each cell of the static experiment; the other two take one."""
    out: str = ""
    """Folder for results, tables and figures; by default a new one under runs/."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder. -: also to standard output, and
    text to standard error."""

    def run(self) -> None:
        """Play it, with results, tables and figures."""
        from pretouch.cli.warm_up import prepare
        from pretouch.profiles import profile
        from pretouch_lab.campaign import Request
        from pretouch_lab.cli.campaigns import run_all

        out = Path(self.out) if self.out else new_folder("demo")
        few = Request(("avoidance", "dynamic"), seeds=1, profiles=_DEMONSTRATED)
        many = Request(("static",), seeds=self.seeds, profiles=_DEMONSTRATED)
        prepare(profile("pretouch"))  # each worker would compile the same, and the bar would stand still
        # the long trials first, so that the bar moves on in small steps towards the end
        run_all([(few, out / "people"), (many, out / "static")], out, self.json)


@dataclass(frozen=True)
class Reproduce:
    """Run the paper's experiments in full. A run that was stopped goes on where it was, with the same parameters."""

    experiment: tyro.conf.Positional[str] = "all"
    """static (paper IV-A), avoidance (IV-B), dynamic (IV-C), between (its close-up), one of the studies, or all,
    which takes about half an hour on two processors."""
    seeds: int = 12
    """Trials of each cell; each seed is another arm with other errors, noise and geometry."""
    first_seed: int = 0
    """The first of them; only seed 0 is recorded and drawn unasked."""
    profiles: Words = ("blind", "paper")
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. With `all`
    the studies have their own."""
    restrictions: Words = ()
    """off, hard, slack or floor, or several of them; by default off in the static experiment and slack in others."""
    stiffness: Numbers = (25000.0,)
    """Contact stiffness of the static object [N/m], or several, separated by commas."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    arm: str = ""
    """Name of an arm, or the folder of an imported one, for static, avoidance and dynamic; by default the Panda. The
    paper's paths and places are scaled and moved into its reach, and the skin is the arm's own."""
    world: str = ""
    """Set of simulated arms, sensors and delays: nominal, realistic, stress, or a TOML file, of which each trial's seed
    draws its own; by default the usual ones."""
    record: str = "first"
    """first: record the trials of the first seed of which figures are drawn; all: record every trial."""
    out: str = ""
    """Folder for results, recordings, tables and figures; by default runs/reproduce-EXPERIMENT."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder. -: also to standard output, and
    text to standard error."""

    def run(self) -> None:
        """Run the experiments, with results, recordings, tables and figures."""
        from pretouch.sim.plant_params import assumed_plant
        from pretouch_lab.campaign import Request
        from pretouch_lab.cli.campaigns import run_all
        from pretouch_lab.domain_randomisation import folder_part
        from pretouch_lab.paper.whole import whole_paper
        from pretouch_lab.registry import EXPERIMENTS

        everything = self.experiment == "all"
        request = Request(
            experiments=tuple(EXPERIMENTS) if everything else (self.experiment,),
            seeds=self.seeds,
            profiles=self.profiles,
            restrictions=self.restrictions,
            stiffness=self.stiffness,
            skin=self.skin or None,
            record=self.record,
            arm=self.arm or None,
            first_seed=self.first_seed,
            world=self.world or None,
        )
        if request.arm and not everything:
            context = request.context()
            print(context.placement.sentence(context.model.description.name))
            print(assumed_plant(context.model.description))
        out = Path(self.out or f"runs/reproduce-{self.experiment}{folder_part(self.world)}")
        runs = [(part, out / name) for name, part in whole_paper(request)] if everything else [(request, out)]
        run_all(runs, out, self.json)


@dataclass(frozen=True)
class Figure:
    """Draw one figure of the paper, from trials that are played for it."""

    name: tyro.conf.Positional[str]
    """circle (Fig. 4), interaction (Fig. 5), close-up (Fig. 6) or force-difference (Fig. 7)."""
    out: str = ""
    """File to write, ending in .png, .pdf or .svg; by default NAME.png."""
    profile: str = "paper"
    """Profile that is shown."""
    seed: int = 0
    """Seed of the trials."""

    def run(self) -> None:
        """Draw the figure."""
        from pretouch_lab.cli.figure import draw_figure

        out = Path(self.out or f"{self.name}.png")
        print(f"Figure: {draw_figure(self.name, out, self.profile, self.seed)}")


def new_folder(name: str) -> Path:
    """Return a folder under runs/ that is not there yet."""
    return next(path for n in count(1) if not (path := Path("runs") / f"{name}-{n}").exists())
