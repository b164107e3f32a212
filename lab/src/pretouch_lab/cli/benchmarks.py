"""Benchmarks of `pretouch bench`: play missing trials, print and write tables, and return the numbers."""

import sys
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from rich.console import Console

from pretouch import __version__
from pretouch.calibration.motion.planner import plan_motion
from pretouch.cli.tables import show
from pretouch.errors import CalibrationError, ExperimentError
from pretouch.realtime import check_wishes
from pretouch.robot.description import files_digest, robot_named
from pretouch.robot.model import RobotModel
from pretouch.sim.plant_params import assumed_plant
from pretouch.text_table import TextTable
from pretouch_lab import options as lab_options
from pretouch_lab.bench import avoidance as avoiding
from pretouch_lab.bench import calibration as calibrating
from pretouch_lab.bench import cycle as timing
from pretouch_lab.bench import detection as detecting
from pretouch_lab.bench import localization as locating
from pretouch_lab.bench import real as recorded
from pretouch_lab.bench import shield as shielding
from pretouch_lab.bench.avoidance_scenes import PANDA, arm, place
from pretouch_lab.bench.detection_results import results
from pretouch_lab.bench.detection_tables import tables
from pretouch_lab.bench.real_sets import files_digest as sets_digest
from pretouch_lab.bench.real_sets import sets_in
from pretouch_lab.bench.scenes import checksums
from pretouch_lab.bench.workload import LARGEST_SKIN
from pretouch_lab.cli.playing import begin, played, report
from pretouch_lab.domain_randomisation import folder_part, sentence, world_set
from pretouch_lab.run import Row, plays_of


def _folder(options: lab_options.Published, name: str, **more: Any) -> Path:
    """Create the folder for a published benchmark's results, or continue one of a run with the same options."""
    world = options.world if isinstance(options, lab_options.InWorlds) else ""
    out = options.folder(f"bench-{name}{folder_part(world)}{'-quick' if options.quick else ''}")
    scenarios = sha256(repr(sorted(checksums().items())).encode()).hexdigest()
    about = {"bench": name, "seeds": options.seeds, "world": world, "scenarios_sha256": scenarios, **more}
    begin(options, out, about | ({"world_sha256": world_set(world).digest} if world else {}))
    if world:
        print(sentence(world))
    return out


def _finished(
    options: lab_options.Published, name: str, out: Path, tables: list[TextTable], text: str = "", **numbers: Any
) -> dict[str, Any]:
    """Print tables and write them with a text; return the numbers with the options of the run."""
    kind, world = "quick" if options.quick else "full", getattr(options, "world", "")
    about = {"bench": name, "version": __version__, "quick": options.quick, "seeds": options.seeds}
    report(tables, [], out, f"Version {__version__}, {options.seeds} seeds, {kind} run. {text}\n")
    return {"about": about | ({"world": world} if world else {}), **numbers, "tables": tables}


def detection(options: lab_options.DetectionOptions) -> dict[str, Any]:
    """See its options."""
    out = _folder(options, "detection", quick=options.quick)
    arms = detecting.plays(options.seeds, options.quick, options.world)
    numbers = results(detecting.rows_of(played("detection", detecting.trial, arms, out, options)))
    return _finished(options, "detection", out, tables(numbers), numbers["resolution"], **numbers)


def avoidance(options: lab_options.AvoidanceOptions) -> dict[str, Any]:
    """See its options."""
    trials = avoiding.plays(options.seeds, options.quick, options.baselines, options.scenarios)
    other: Row = {}
    if options.arm != PANDA:
        described = arm(options.arm).description
        other = {"arm": options.arm, "arm_sha256": files_digest(described)}
        print(place(options.arm).sentence(described.name), assumed_plant(described), sep="\n")
    out = _folder(options, "avoidance", **other)  # a quick run shares its trials with a full one
    trial = partial(avoiding.trial, options.world, options.arm)
    summary = avoiding.summarise(played("avoidance", trial, trials, out, options))
    result_tables, cells = avoiding.tables(summary), summary.pop("cells")
    counts = [cell["trials"] for cell in cells]
    text = f"{min(counts)} to {max(counts)} trials of each contender in each scenario."
    return _finished(options, "avoidance", out, result_tables, text, rows=cells, **summary)


def localization(options: lab_options.LocalizationOptions) -> dict[str, Any]:
    """See its options."""
    out = _folder(options, "localization")
    arms = played("localization", locating.trial, locating.plays(options.seeds, options.quick), out, options)
    rows = locating.results(locating.rows_of(arms))
    return _finished(options, "localization", out, locating.tables(rows), rows=rows)


def shield(options: lab_options.ShieldOptions) -> dict[str, Any]:
    """See its options."""
    out, trials = _folder(options, "shield"), shielding.plays(options.seeds, options.quick)
    rows = shielding.results(played("shield", shielding.trial, trials, out, options))
    return _finished(options, "shield", out, shielding.tables(rows), rows=rows)


def real(options: lab_options.RealOptions) -> dict[str, Any]:
    """See its options."""
    recorded.check(options.detectors)  # an error now, and not after an hour
    sets, left_out = sets_in(options.sets)
    trials = [({"set": each.name, "detector": name}, 0) for each in sets for name in options.detectors]
    out, folder = options.folder("bench-real"), options.sets.absolute()
    begin(options, out, {"bench": "real", "sets": str(folder), "files_sha256": sets_digest(sets, folder)})
    for sentence_of_set in left_out:
        print(sentence_of_set, file=sys.stderr)
    rows = played("recordings", partial(recorded.trial, folder), trials, out, options)
    result_tables, sources = recorded.tables(rows), {each.name: each.source for each in sets}
    report(result_tables, [], out)
    return {"sets": sources, "left_out": left_out, "rows": rows, "tables": result_tables}


def calibration(options: lab_options.CalibrationOptions) -> dict[str, Any]:
    """See its options."""
    if options.skins < 1:
        raise CalibrationError(f"The number of skins is {options.skins}: give at least 1.")
    if options.seed < 0:
        raise CalibrationError(f"The seed is {options.seed}: give at least 0.")
    out, model = options.folder("bench-calibration"), RobotModel(robot_named(options.arm))
    described = {"arm": options.arm, "arm_sha256": files_digest(model.description)}
    begin(options, out, {"bench": "calibration", **described, "motion": repr(options.motion)})
    plan = plan_motion(model, options.motion)
    trials = plays_of([{"find_links": options.find_links}], range(options.seed, options.seed + options.skins))
    rows = played("skins", partial(calibrating.trial, options.arm, plan), trials, out, options)
    result_tables = calibrating.tables(rows, plan.duration)
    report(result_tables, [], out)
    return {"rows": rows, "motion_s": plan.duration, "tables": result_tables}


def cycle(options: lab_options.CycleOptions) -> dict[str, Any]:
    """See its options."""
    how = options.rate, options.cycles, options.profile, options.priority, options.cpu
    request = timing.CycleRequest(*how, arm=options.arm)
    if not options.points or not 1 <= min(options.points) <= max(options.points) <= LARGEST_SKIN:
        numbers = ", ".join(map(str, options.points)) or "none"
        raise ExperimentError(f"The numbers of points are {numbers}: give 1 to {LARGEST_SKIN}.")
    check_wishes(options.priority, options.cpu)
    rows: list[Row] = []
    sentences: list[str] = []
    for points in options.points:
        seconds = request.cycles / request.rate_hz
        print(f"{points} points: {request.cycles} cycles, {seconds:.0f} s or more.", file=sys.stderr)
        rows.append(timing.measure(points, request, sentences.append))
    missing = list(dict.fromkeys(sentences))
    show(Console(highlight=False), timing.tables(rows, request))
    print(*missing, sep="\n")
    return {"about": {**timing.about(request), "missing": missing, "asked": options.points}, "rows": rows}
