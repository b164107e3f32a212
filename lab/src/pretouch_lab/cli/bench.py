"""`pretouch bench`: its docstrings are the help."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from pretouch.calibration.motion.limits import PlanParams
from pretouch.cli.options import Counts, JsonFile, Words
from pretouch.errors import CalibrationError, ExperimentError
from pretouch_lab.cli.benchmarks import Avoidance, Both, Detection, Localization, Shield
from pretouch_lab.options import Playing

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.run import Row


@dataclass(frozen=True)
class Real(Playing):
    """Contact detectors on public recordings of real arms, which you download: false alarms, contacts, delays, links.

    One half of each set's recordings says what load, offsets and friction the arm has, the other is judged; then the
    other way round. docs/explanation/benchmarks.md tells how the folder is laid out.
    """

    sets: tyro.conf.Positional[Path] = field(kw_only=True)
    """Folder of the sets, each by its name, with `arms` as `pretouch robot import` wrote them."""
    detectors: Words = ()
    """Profiles, separated by commas; by default fixed, observer, paper and pretouch."""

    def run(self) -> None:
        """Play what is there, with tables and rows."""
        from pretouch.cli.writing import numbers_to
        from pretouch.profiles import profile
        from pretouch_lab.bench.real import DETECTORS, tables, trial
        from pretouch_lab.bench.real_sets import files_digest, sets_in
        from pretouch_lab.cli.playing import check_json, played, report
        from pretouch_lab.run import open_run

        detectors = self.detectors or DETECTORS
        for name in detectors:
            profile(name)  # an hour later would be late
        sets, missing = sets_in(self.sets)
        plays = [({"set": each.name, "detector": name}, 0) for each in sets for name in detectors]
        out = self.folder("bench-real")
        check_json(self, [out])
        with numbers_to(self.json) as write:
            folder = self.sets.absolute()
            open_run(out, {"bench": "real", "sets": str(folder), "files_sha256": files_digest(sets, folder)})
            for sentence in missing:
                print(sentence, file=sys.stderr)
            rows = played("recordings", partial(trial, folder), plays, out, self)
            made = tables(rows)
            report(made, [], out)
            sources = {each.name: each.source for each in sets}
            write({"sets": sources, "left_out": missing, "rows": rows, "tables": made})


@dataclass(frozen=True)
class Calibration(Playing):
    """How far units on random skins are found from where they sit, by `pretouch skin calibrate` in simulation."""

    skins: int = 20
    """How many; each has a unit on each link from the second on."""
    find_links: bool = False
    """Do not tell the calibration which links the units sit on."""
    motion: PlanParams = field(default_factory=PlanParams)
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    seed: int = 0
    """Decides all that is random."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        from pretouch.calibration.motion.planner import plan_motion
        from pretouch.cli.writing import numbers_to
        from pretouch.robot.description import files_digest, robot_named
        from pretouch.robot.model import RobotModel
        from pretouch_lab.bench.calibration import tables, trial
        from pretouch_lab.cli.playing import check_json, played, report
        from pretouch_lab.run import open_run, plays_of

        if self.skins < 1:
            raise CalibrationError(f"The number of skins is {self.skins}: give at least 1.")
        if self.seed < 0:
            raise CalibrationError(f"The seed is {self.seed}: it must be at least 0.")
        out, model = self.folder("bench-calibration"), RobotModel(robot_named(self.arm))
        check_json(self, [out])
        with numbers_to(self.json) as write:
            arm = {"arm": self.arm, "arm_sha256": files_digest(model.description)}
            open_run(out, {"bench": "calibration", **arm, "motion": repr(self.motion)})
            plan = plan_motion(model, self.motion)
            plays = plays_of([{"find_links": self.find_links}], range(self.seed, self.seed + self.skins))
            rows = played("skins", partial(trial, self.input(self.arm), plan), plays, out, self)
            made = tables(rows, plan.duration)
            report(made, [], out)
            write({"rows": rows, "motion_s": plan.duration, "tables": made})


@dataclass(frozen=True)
class Cycle:
    """How long a control step takes: processor and wall time at a rate, and overruns."""

    points: Counts = (7, 32, 128, 1000)
    """Numbers of sensed points, separated by commas, each shown by a unit 50 times a second."""
    rate: float = 1000.0
    """Cycles a second; everything the profile counts in cycles is brought to it."""
    cycles: int = 20_000
    """Steps measured for each number of points."""
    profile: str = "paper"
    """Profile of the controller, or PROFILE:GROUP.FIELD=VALUE."""
    arm: str = "panda"
    """Name of an arm, or the folder of an imported one."""
    json: JsonFile = None
    priority: int | None = None
    """Real-time priority, 1 to 99 (80 is usual); by default the process keeps its own."""
    cpu: int | None = None
    """Number of the processor to stay on; by default the system decides."""

    def run(self) -> None:
        """Measure, show, and write the numbers if a file is given."""
        from pretouch.cli.writing import numbers_to
        from pretouch.realtime import check_wishes
        from pretouch_lab.bench.cycle import CycleRequest
        from pretouch_lab.bench.workload import LARGEST_SKIN

        request = CycleRequest(self.rate, self.cycles, self.profile, self.priority, self.cpu, arm=self.arm)
        wrong = [n for n in self.points if not 1 <= n <= LARGEST_SKIN]
        if wrong or not self.points:
            found = wrong[0] if wrong else "missing"
            raise ExperimentError(f"The number of points is {found}: give 1 to {LARGEST_SKIN}.")
        check_wishes(self.priority, self.cpu)
        with numbers_to(self.json) as write:
            _measure(self.points, request, write)


def _measure(points: Sequence[int], request: Any, write: Callable[[Any], None]) -> None:
    """Measure with each number of points; what was measured before something ended it is shown and written too."""
    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch_lab.bench.cycle import about, measure, tables

    rows: list[Row] = []
    sentences: list[str] = []
    try:
        for n in points:
            seconds = request.cycles / request.rate_hz
            print(f"{n} points: {request.cycles} cycles, {seconds:.0f} s or more.", file=sys.stderr)
            rows.append(measure(n, request, sentences.append))
    finally:
        if rows:
            missing = list(dict.fromkeys(sentences))
            # first, for the terminal may be gone
            write({"about": {**about(request), "missing": missing, "asked": points}, "rows": rows})
            show(Console(highlight=False), tables(rows, request))
            print(*missing, sep="\n")
        if len(rows) < len(points):
            print(f"Stopped: {len(rows)} of {len(points)} numbers of points were measured.", file=sys.stderr)


@dataclass(frozen=True)
class Bench:
    """Measure something: detectors, ways to avoid people, places of contacts, or a step's time."""

    what: (
        Annotated[Detection, tyro.conf.subcommand("detection")]
        | Annotated[Avoidance, tyro.conf.subcommand("avoidance")]
        | Annotated[Localization, tyro.conf.subcommand("localization")]
        | Annotated[Shield, tyro.conf.subcommand("shield")]
        | Annotated[Both, tyro.conf.subcommand("both")]
        | Annotated[Cycle, tyro.conf.subcommand("cycle")]
        | Annotated[Calibration, tyro.conf.subcommand("calibration")]
        | Annotated[Real, tyro.conf.subcommand("real")]
    )

    def run(self) -> int | None:
        """Run the benchmark."""
        return self.what.run()
