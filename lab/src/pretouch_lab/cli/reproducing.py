"""Run `pretouch reproduce`, `demo` and `figure`: play missing trials, print and write tables and figures."""

import sys
from dataclasses import replace
from functools import partial
from io import BytesIO
from itertools import count, product
from pathlib import Path
from typing import Any

from rich.console import Console

from pretouch.cli.warm_up import prepare
from pretouch.cli.writing import check_writable, numbers_to, unwritable_said
from pretouch.errors import ExperimentError, PretouchError
from pretouch.profiles import profile
from pretouch.recording.reader import open_recording
from pretouch.reporting.record import gather
from pretouch.sim.plant_params import assumed_plant
from pretouch_lab.cli.playing import DrawnFigure, begin, check_numbers, played, report
from pretouch_lab.experiment import NAMES, arguments, check, context_of, experiment, play, recording_file
from pretouch_lab.options import Playing, TrialOptions
from pretouch_lab.run import Row
from pretouch_lab.trial import trace_of

_DEMONSTRATED = ("blind", "paper", "pretouch")
_PROFILES = (*TrialOptions.profiles, "slowing-only", "thresholds-only", "paper-0.5m")
_STIFFNESS = (2_000.0, 25_000.0, 75_000.0, 300_000.0)
_MODES = ("hard", "slack", "floor")
_CLOSE_UPS = 12
"""Most seeds of the experiment `between`."""
_ENDINGS = (".png", ".pdf", ".svg")
Part = tuple[str, str, TrialOptions]
"""Name of a folder, an experiment, and the options of its trials in the folder."""


def demonstrate(seeds: int, out: str, json: Path | None) -> None:
    """Play a small part of the paper's three experiments."""
    one, many = (TrialOptions(number, profiles=_DEMONSTRATED) for number in (1, seeds))
    check(many, ("static",))
    # the long trials first, so that the bar moves in small steps towards the end
    parts = [("avoidance", "avoidance", one), ("dynamic", "dynamic", one), ("static", "static", many)]
    how = Playing(out or str(new_folder("demo")), json)
    prepare(profile("pretouch"))  # else each worker would compile the same, and the bar would stand still
    reproduce(parts, Path(how.out), how)


def new_folder(name: str) -> Path:
    """Return a new folder's name under runs/."""
    return next(path for n in count(1) if not (path := Path("runs") / f"{name}-{n}").exists())


def whole_paper(options: TrialOptions) -> list[Part]:
    """Return all parts of `pretouch reproduce all`.

    Other profiles and stiffnesses than the defaults replace those of the paper's three experiments; the defaults are
    extended by further values.
    """
    check(options, NAMES)
    profiles = _PROFILES if options.profiles == TrialOptions.profiles else options.profiles
    stiffness = _STIFFNESS if options.stiffness == TrialOptions.stiffness else options.stiffness
    whole = replace(options, profiles=profiles)
    parts = [("static", "static", replace(whole, stiffness=stiffness))]
    parts += [(name, name, whole) for name in ("avoidance", "dynamic")]
    if not options.restrictions and "paper" in profiles:
        parts.append(("restrictions", "static", replace(options, profiles=("paper",), restrictions=_MODES)))
    seeds = min(options.seeds, _CLOSE_UPS)
    close_up = TrialOptions(seeds, options.first_seed, skin=options.skin, world=options.world)
    return [*parts, ("between", "between", close_up)]


def compared(name: str, options: TrialOptions) -> list[Part]:
    """Return a part for each arm and skin of an experiment's options; several have folders of their own."""
    pairs = [*product(options.arm.split(","), options.skin.split(","))]
    parts = [(f"{Path(a).name or 'panda'}-{Path(s).stem or 'own'}", replace(options, arm=a, skin=s)) for a, s in pairs]
    return [(folder if len(pairs) > 1 else "", name, each) for folder, each in parts]


def reproduce(parts: list[Part], folder: Path, how: Playing) -> None:
    """Play the missing trials of all parts, and print and write tables and figures of all rows."""
    for _, name, options in parts:
        check(options, (name,))
        if options.arm:
            context = context_of(options.arm, options.skin, options.world)
            described = context.model.description
            print(context.placement.sentence(described.name), assumed_plant(described), sep="\n")
    plays = [experiment(name).plays(options) for _, name, options in parts]
    with numbers_to(how.json) as write:
        check_numbers(how, folder)
        for where, name, options in parts:
            begin(how, folder / where, arguments(name, options))
        rows: dict[str, list[Row]] = {}
        for (where, name, options), own in zip(parts, plays, strict=True):
            trial = partial(play, name, options, folder / where)
            rows[name] = rows.get(name, []) + played(where or name, trial, own, folder / where, how)
        tables = [table for name, own in rows.items() for table in experiment(name).tables(own)]
        figures = [each for part in parts for each in _figure_of(*part, folder, rows[part[1]])]
        report(tables, figures, folder)
        write({"rows": [{"experiment": name, **row} for name, own in rows.items() for row in own], "tables": tables})


def _figure_of(where: str, name: str, options: TrialOptions, folder: Path, rows: list[Row]) -> list[DrawnFigure]:
    """Draw a part's figure from the recordings of seed 0, if it has a figure and they can be read."""
    what = experiment(name)
    names = list(what.cells(options)[0])
    if what.drawing is None or where not in ("", name):
        return []
    traces: list[tuple[Row, Any]] = []
    try:
        for row in what.drawing.cells([row for row in rows if row["seed"] == 0]):
            cell = {key: row[key] for key in names}
            file = recording_file(folder / where, cell, 0)
            traces.append((cell, gather(open_recording(file))))
    except PretouchError as error:
        print(f"The figure of {where or name} does not show {file}: {error}", file=sys.stderr)
    if not traces:
        return []
    units = context_of(options.arm, options.skin, options.world, traces[0][0]["profile"]).skin.ids
    return [(name, what.drawing.text, what.drawing.draw(traces, units))]


def draw_figure(name: str, out: Path, profile_name: str = "paper", seed: int = 0) -> None:
    """Draw one of the paper's figures into a file; all errors of the arguments come before the first trial."""
    drawings = {own.drawing.name: (own, own.drawing) for own in map(experiment, NAMES) if own.drawing}
    if name not in drawings:
        raise ExperimentError(f"The figure {name!r} is unknown: choose from {', '.join(drawings)}.")
    if seed < 0:
        raise ExperimentError(f"The seed is {seed}: give 0 or more.")
    what, drawing = drawings[name]
    if profile(profile_name).perception is None and drawing.beside:
        raise ExperimentError(f"The figure {name} cannot show {profile_name}, which has no proximity: name another.")
    if out.suffix not in _ENDINGS:
        raise ExperimentError(f"The figure {out} has no known format: end its name in {', '.join(_ENDINGS)}.")
    check_writable("figure", out)
    console, traces = Console(stderr=True, highlight=False, soft_wrap=True), []
    for cell in drawing.cells(what.cells(TrialOptions(profiles=(*drawing.beside, profile_name)))):
        console.print(f"Playing {', '.join(map(str, cell.values()))} with seed {seed}.", markup=False)
        record = what.trial(cell, seed, context_of("", "", "", cell["profile"]))[1]
        if record is not None:
            traces.append((cell, trace_of(record)))
    image = BytesIO()
    drawing.draw(traces, context_of("", "", "", profile_name).skin.ids).savefig(image, format=out.suffix[1:], dpi=150)
    with unwritable_said("figure", out):
        out.write_bytes(image.getvalue())
