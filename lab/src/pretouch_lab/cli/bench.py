"""`pretouch bench`: its docstrings are the help."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from pretouch.cli.options import Counts, JsonFile
from pretouch_lab.cli.bench_calibration import Calibration
from pretouch_lab.cli.bench_real import Real
from pretouch_lab.cli.benchmarks import Avoidance, Both, Detection, Localization, Shield


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
        from pretouch_lab.benchmarks.cycle import CycleRequest
        from pretouch_lab.cli.bench_cycle import bench_cycle

        request = CycleRequest(self.rate, self.cycles, self.profile, self.priority, self.cpu, arm=self.arm)
        bench_cycle(self.points, request, self.json)


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
