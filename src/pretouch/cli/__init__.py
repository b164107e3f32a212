"""The command `pretouch`."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from types import FrameType
from typing import Annotated

import tyro
from rich.console import Console

from pretouch.errors import ParameterError, PretouchError

# the rest of the package takes a second to import: only the functions that run something do

_USAGE, _INTERRUPTED = 2, 130
_TERMINATED = 143


@dataclass(frozen=True)
class Demo:
    """Play a small part of the paper's three experiments, blind and with proximity, and show what came out."""

    seeds: int = 4
    """Trials of each cell of the static experiment; the other two take one."""
    out: str = ""
    """Folder for results, figures and page; by default a new one under runs/."""


@dataclass(frozen=True)
class Reproduce:
    """Run the paper's experiments in full. A run that was stopped goes on where it was, with the same parameters."""

    experiment: tyro.conf.Positional[str] = "all"
    """static (paper IV-A), avoidance (IV-B), dynamic (IV-C), one of the studies of its claims and weaknesses, or all of
    them, which takes about three quarters of an hour on two processors."""
    seeds: int = 12
    """Trials of each cell; each seed is another arm with other errors, noise and geometry."""
    profiles: str = "blind,paper"
    """Profiles to compare, separated by commas. PROFILE:GROUP.FIELD=VALUE is one with another parameter. With `all`,
    and where only the force estimate is studied, the studies have their own."""
    restrictions: str = ""
    """off, hard, slack or floor, or several of them; by default off in the static experiment and slack in others."""
    orientation: str = ""
    """free or hold: whether the task keeps the hand's orientation; by default the profile's own, hold."""
    stiffness: str = "25000"
    """Contact stiffness of the static object [N/m], or several, separated by commas."""
    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    out: str = ""
    """Folder for results, figures and page; by default runs/reproduce-EXPERIMENT."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder."""


@dataclass(frozen=True)
class Figure:
    """Draw one figure of the paper, from a run that is there or from trials played for it."""

    name: tyro.conf.Positional[str]
    """circle (Fig. 4), interaction (Fig. 5), close-up (Fig. 6), force-difference (Fig. 7) or framework (Fig. 2)."""
    run: str = ""
    """Folder of a run of `reproduce` or `demo` to draw it from; by default what is needed is played first."""
    out: str = ""
    """File to write, ending in .png, .pdf or .svg; by default NAME.png."""
    profile: str = "paper"
    """Profile that is shown."""
    seed: int = 0
    """Seed of the trials that are played; runs keep the course of seed 0."""


@dataclass(frozen=True)
class FreeMotion:
    """How far the force estimate of an arm left alone is off, and which detectors take that for a contact."""

    seeds: int = 10
    """Simulated arms; each is left alone for twenty minutes, a quarter of them standing."""
    out: str = ""
    """Folder for results, figures and page; by default runs/bench-free-motion."""
    json: str = ""
    """File for all trials and their summary; by default results.json in the folder."""


@dataclass(frozen=True)
class Cycle:
    """How long a control step takes: processor and wall time at a rate, overruns, and the share of each stage."""

    points: str = "7,32,128,1000"
    """Numbers of sensed points, separated by commas, each shown by a unit 50 times a second."""
    rate: float = 1000.0
    """Cycles a second; everything the profile counts in cycles is brought to it."""
    cycles: int = 20_000
    """Steps measured for each number of points."""
    profile: str = "paper"
    """Profile of the controller, or PROFILE:GROUP.FIELD=VALUE."""
    json: str = ""
    """File for the numbers; by default they are only shown."""
    priority: int | None = None
    """Real-time priority, 1 to 99 (80 is usual); by default the process keeps its own."""
    cpu: int | None = None
    """Number of the processor to stay on; by default the system decides."""


@dataclass(frozen=True)
class Bench:
    """Measure something: the force estimate of many simulated arms, or the time of a control step."""

    what: Annotated[FreeMotion, tyro.conf.subcommand("free-motion")] | Annotated[Cycle, tyro.conf.subcommand("cycle")]


@dataclass(frozen=True)
class WarmUp:
    """Compile a control step, once after an installation: what comes later then starts within a second."""


Command = (
    Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Figure, tyro.conf.subcommand("figure")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[WarmUp, tyro.conf.subcommand("warm-up")]
)


class _Terminated(BaseException):
    """SIGTERM, turned into an exception so that what is under way can end in order."""


@contextmanager
def _sigterm_raises() -> Iterator[None]:
    def handle(_number: int, _frame: FrameType | None) -> None:
        raise _Terminated

    before = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code: 2 for bad input, 130 or 143 after Ctrl-C or SIGTERM."""
    errors = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        with _sigterm_raises():
            command = tyro.cli(
                Command, prog="pretouch", description="Contact-anticipating robot arms.", args=args,
                config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
            )  # fmt: skip
            match command:
                case Demo():
                    _demo(command)
                case Reproduce():
                    _reproduce(command)
                case Figure():
                    _figure(command)
                case Bench(FreeMotion() as what):
                    _free_motion(what)
                case Bench(Cycle() as what):
                    _cycle(what)
                case WarmUp():
                    _warm_up()
    except PretouchError as error:
        errors.print(str(error), markup=False)
        return _USAGE
    except KeyboardInterrupt:
        return _INTERRUPTED
    except _Terminated:
        return _TERMINATED
    return 0


def _demo(command: Demo) -> None:
    from pretouch.cli.campaigns import run_all
    from pretouch.experiments.campaign import Request

    out = Path(command.out) if command.out else _new_folder("demo")
    few = Request(("avoidance", "dynamic"), seeds=1)
    many = Request(("static",), seeds=command.seeds)
    run_all([(many, out / "static"), (few, out / "people")], out, out / "results.json")


def _new_folder(name: str) -> Path:
    return next(path for n in count(1) if not (path := Path("runs") / f"{name}-{n}").exists())


def _reproduce(command: Reproduce) -> None:
    from pretouch.cli.campaigns import run_all
    from pretouch.experiments.campaign import Request
    from pretouch.experiments.paper import whole_paper
    from pretouch.experiments.registry import EXPERIMENTS

    everything = command.experiment == "all"
    request = Request(
        experiments=tuple(EXPERIMENTS) if everything else (command.experiment,),
        seeds=command.seeds,
        profiles=_words(command.profiles),
        restrictions=_words(command.restrictions),
        orientation=command.orientation or None,
        stiffness=tuple(map(_number, _words(command.stiffness))),
        skin=command.skin or None,
    )
    out = Path(command.out or f"runs/reproduce-{command.experiment}")
    runs = [(part, out / name) for name, part in whole_paper(request)] if everything else [(request, out)]
    run_all(runs, out, Path(command.json) if command.json else out / "results.json")


def _figure(command: Figure) -> None:
    from pretouch.cli.figure import draw_figure

    run = Path(command.run) if command.run else None
    out = Path(command.out or f"{command.name}.png")
    print(f"Figure: {draw_figure(command.name, run, out, command.profile, command.seed)}")


def _free_motion(command: FreeMotion) -> None:
    from pretouch.cli.campaigns import run_all
    from pretouch.experiments.campaign import Request

    out = Path(command.out or "runs/bench-free-motion")
    request = Request(("free-motion",), command.seeds)
    run_all([(request, out)], out, Path(command.json) if command.json else out / "results.json")


def _cycle(command: Cycle) -> None:
    from pretouch.cli.cycle import bench_cycle
    from pretouch.experiments.cycle import CycleRequest

    request = CycleRequest(command.rate, command.cycles, command.profile, command.priority, command.cpu)
    bench_cycle(_counts(command.points), request, Path(command.json) if command.json else None)


def _warm_up() -> None:
    from pretouch.experiments.cycle import CycleRequest, warmed_up

    kept = warmed_up(CycleRequest())
    print(
        f"Compiled, and kept in {kept}." if kept else "Compiled, but there is nowhere to keep it: HOME is not writable."
    )


def _words(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _counts(text: str) -> tuple[int, ...]:
    words = _words(text)
    if not words or not all(word.isdecimal() for word in words):
        raise ParameterError(f"The numbers of points are {text!r}: give whole numbers, separated by commas.")
    return tuple(map(int, words))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"The stiffness is {text!r}: give numbers in N/m, separated by commas.") from None
