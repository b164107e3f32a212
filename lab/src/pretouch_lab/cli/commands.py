"""`pretouch demo`, `reproduce` and `figure`: their docstrings are the help."""

import sys
from dataclasses import dataclass, fields, replace
from functools import partial
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from pretouch.cli.options import JsonFile
from pretouch_lab.options import Options, Playing

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from matplotlib.figure import Figure as DrawnFigure

    from pretouch_lab.run import Row

_DEMONSTRATED = ("blind", "paper", "pretouch")
_PROFILES = (*Options.profiles, "slowing-only", "thresholds-only", "paper-0.5m")
_STIFFNESS = (2_000.0, 25_000.0, 75_000.0, 300_000.0)
_MODES = ("hard", "slack", "floor")
_STUDIES = {"between": 12, "mounting": 6, "coverage": 4, "two-arms": 3}
"""Studies beside the paper's experiments, each with its number of seeds."""
_ENDINGS = (".png", ".pdf", ".svg")
Part = tuple[str, str, Options]
"""A folder's name, an experiment, and which of its trials are kept there."""


@dataclass(frozen=True)
class Demo:
    """Play a small part of the paper's three experiments: blind, as the paper, and as we do it, side by side."""

    seeds: int = 4
    """Trials of each cell of the static experiment; the other two take one."""
    out: str = ""
    """Folder for rows, tables and figures; by default a new one under runs/."""
    json: JsonFile = None

    def run(self) -> None:
        """Play it, with rows, tables and figures."""
        from pretouch.cli.warm_up import prepare
        from pretouch.profiles import profile
        from pretouch_lab.experiment import check

        one, many = (Options(seeds, profiles=_DEMONSTRATED) for seeds in (1, self.seeds))
        check(many, ("static",))
        # the long trials first, so that the bar moves on in small steps towards the end
        parts = [(name, name, one) for name in ("avoidance", "dynamic")]
        how = Playing(self.out or str(new_folder("demo")), self.json)
        prepare(profile("pretouch"))  # each worker would compile the same, and the bar would stand still
        reproduce([*parts, ("static", "static", many)], Path(how.out), how)


@dataclass(frozen=True)
class Reproduce(Playing, Options):
    """Run the paper's experiments in full. A run that was stopped goes on where it was, with the same options."""

    experiment: tyro.conf.Positional[str] = "all"
    """static (paper IV-A), avoidance (IV-B), dynamic (IV-C), between (its close-up), one of the studies, or all,
    which takes about half an hour on two processors."""

    def run(self) -> None:
        """Run the experiments, with rows, recordings, tables and figures."""
        from pretouch.sim.plant_params import assumed_plant
        from pretouch_lab.domain_randomisation import folder_part
        from pretouch_lab.experiment import NAMES, check, context_of

        options = Options(**{each.name: getattr(self, each.name) for each in fields(Options)})
        parts = whole_paper(options) if self.experiment == "all" else [("", self.experiment, options)]
        check(options, NAMES if self.experiment == "all" else (self.experiment,))
        if options.arm:
            context = context_of(options.arm, options.skin, options.world)
            print(context.placement.sentence(context.model.description.name))
            print(assumed_plant(context.model.description))
        reproduce(parts, self.folder(f"reproduce-{self.experiment}{folder_part(self.world)}"), self)


def whole_paper(options: Options) -> list[Part]:
    """Return all parts of `pretouch reproduce all`.

    A study has no more seeds than `options`, nor than its own number. Profiles, restrictions and stiffnesses that are
    given replace those of the paper's three experiments; where they are the defaults, these are varied as well.
    """
    profiles = _PROFILES if options.profiles == Options.profiles else options.profiles
    stiffness = _STIFFNESS if options.stiffness == Options.stiffness else options.stiffness
    whole = replace(options, profiles=profiles)
    parts = [("static", "static", replace(whole, stiffness=stiffness))]
    parts += [(name, name, whole) for name in ("avoidance", "dynamic")]
    if not options.restrictions and "paper" in profiles:
        parts.append(("restrictions", "static", replace(options, profiles=("paper",), restrictions=_MODES)))
    study = Options(skin=options.skin, world=options.world, first_seed=options.first_seed)
    return parts + [(name, name, replace(study, seeds=min(options.seeds, n))) for name, n in _STUDIES.items()]


def reproduce(parts: list[Part], folder: Path, how: Playing) -> None:
    """Play the parts of a run that are not there yet, and show and write tables and figures of all of them."""
    from pretouch.cli.writing import numbers_to
    from pretouch_lab.cli.playing import check_json, played, report
    from pretouch_lab.experiment import arguments, check, experiment, play
    from pretouch_lab.run import open_run

    for _, name, options in parts:
        check(options, (name,))
    plays = [experiment(name).plays(options) for _, name, options in parts]
    check_json(how, [folder, *(folder / where for where, _, _ in parts)])
    with numbers_to(how.json) as write:
        for where, name, options in parts:
            open_run(folder / where, arguments(name, options))
        rows: dict[str, list[Row]] = {}
        for (where, name, options), own in zip(parts, plays, strict=True):
            skin, arm, world = map(how.input, (options.skin, options.arm, options.world))
            trial = partial(play, name, replace(options, skin=skin, arm=arm, world=world), folder / where)
            rows[name] = rows.get(name, []) + played(where or name, trial, own, folder / where, how)
        tables = [table for name, own in rows.items() for table in experiment(name).tables(own)]
        figures = [each for part in parts for each in _figure_of(*part, folder, rows[part[1]])]
        report(tables, figures, folder)
        numbered = [{"experiment": name, **row} for name, own in rows.items() for row in own]
        write({"rows": numbered, "tables": tables})


def _figure_of(
    where: str, name: str, options: Options, folder: Path, rows: "list[Row]"
) -> "list[tuple[str, str, DrawnFigure]]":
    """Draw a part's figure of the recordings of its first seed, if it has one and they can be read."""
    from pretouch.errors import PretouchError
    from pretouch.recording.reader import open_recording
    from pretouch.reporting.record import gather
    from pretouch_lab.experiment import context_of, experiment, recording_file

    what = experiment(name)
    names = list(what.cells(options)[0])
    if what.drawing is None or where == "restrictions":
        return []
    traces: list[tuple[dict[str, Any], Any]] = []
    try:
        for row in what.drawing.shown([row for row in rows if row["seed"] == 0]):
            cell = {key: row[key] for key in names}
            file = recording_file(folder / where, cell, 0)
            traces.append((cell, gather(open_recording(file))))
    except PretouchError as error:
        print(f"The figure of {where or name} does not show {file}: {error}", file=sys.stderr)
    if not traces:
        return []
    units = context_of(options.arm, options.skin, options.world).skin.ids
    return [(name, what.drawing.text, what.drawing.draw(traces, units))]


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
        out = Path(self.out or f"{self.name}.png")
        draw_figure(self.name, out, self.profile, self.seed)
        print(f"Figure: {out}")


def draw_figure(name: str, out: Path, profile: str = "paper", seed: int = 0) -> None:
    """Draw one of the paper's figures into a file; whatever is wrong is said before anything is played."""
    from rich.console import Console

    from pretouch.cli.writing import check_writable, unwritable_said
    from pretouch.errors import ExperimentError
    from pretouch.profiles import profile as profile_named
    from pretouch_lab.experiment import NAMES, context_of, experiment
    from pretouch_lab.trial import trace_of

    drawings = {own.drawing.name: (own, own.drawing) for own in map(experiment, NAMES) if own.drawing}
    if name not in drawings:
        raise ExperimentError(f"The figure {name!r} is unknown: choose from {', '.join(drawings)}.")
    if seed < 0:
        raise ExperimentError(f"The seed is {seed}: give 0 or more.")
    what, drawing = drawings[name]
    if profile_named(profile).perception is None and drawing.beside:
        raise ExperimentError(f"The figure {name} cannot show {profile}, which has no proximity: name another.")
    if out.suffix not in _ENDINGS:
        raise ExperimentError(f"The figure {out} has no ending that says its format: use {', '.join(_ENDINGS)}.")
    check_writable("figure", out)
    console, context, traces = Console(stderr=True, highlight=False, soft_wrap=True), context_of("", "", ""), []
    for cell in drawing.shown(what.cells(Options(profiles=(*drawing.beside, profile)))):
        console.print(f"Playing {', '.join(map(str, cell.values()))} with seed {seed}.", markup=False)
        record = what.trial(cell, seed, context)[1]
        if record is not None:
            traces.append((cell, trace_of(record)))
    image = BytesIO()
    drawing.draw(traces, context.skin.ids).savefig(image, format=out.suffix[1:], dpi=150)
    with unwritable_said("figure", out):
        out.write_bytes(image.getvalue())


def new_folder(name: str) -> Path:
    """Return a folder under runs/ that is not there yet."""
    return next(path for n in count(1) if not (path := Path("runs") / f"{name}-{n}").exists())
