"""The command `pretouch`."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from types import FrameType

import tyro
from rich.console import Console

from pretouch.cli.commands import (
    Bench,
    Command,
    Cycle,
    Demo,
    Detect,
    Figure,
    FreeMotion,
    Live,
    Recover,
    Replay,
    Report,
    Reproduce,
    WarmUp,
)  # fmt: skip
from pretouch.cli.skin_commands import Skin
from pretouch.errors import ParameterError, PretouchError

# the rest of the package takes a second to import: only the functions that run something do

_USAGE, _INTERRUPTED = 2, 130


class _Terminated(BaseException):
    """SIGTERM, or SIGHUP of a terminal that closed, so that what is under way can end in order."""

    def __init__(self, number: int) -> None:
        self.code = 128 + number


@contextmanager
def _ends_raise() -> Iterator[None]:
    def handle(number: int, _frame: FrameType | None) -> None:
        raise _Terminated(number)

    # nohup has SIGHUP ignored, and wants it so
    ours = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in ours}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code: 2 for bad input, 130, 143 or 129 after Ctrl-C, SIGTERM or SIGHUP."""
    errors = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        with _ends_raise():
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
                case Live():
                    _live(command)
                case Replay():
                    return _replay(command)
                case Recover():
                    _recover(command)
                case Detect():
                    _detect(command)
                case Report():
                    _report(command)
                case Skin():
                    return _skin(command)
                case WarmUp():
                    _warm_up()
    except PretouchError as error:
        errors.print(str(error), markup=False)
        return _USAGE
    except KeyboardInterrupt:
        return _INTERRUPTED
    except _Terminated as end:
        return end.code
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
        record=command.record,
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


def _detect(command: Detect) -> None:
    from pretouch.cli.detect import detect
    from pretouch.foreign.source import Choice

    c = command
    choice = Choice(c.wrench, c.joints, c.sign, c.frame, c.zeros, c.arm, ranges=bool(c.skin))
    skin, out, json = (Path(text) if text else None for text in (c.skin, c.out, c.json))
    detect(Path(c.file), choice, _words(c.profiles), skin, c.rate, out, json)


def _replay(command: Replay) -> int:
    from pretouch.cli.replay import replay

    c = command
    return replay(Path(c.file), c.verify, c.profile, c.page, c.host, c.port)


def _recover(command: Recover) -> None:
    from pretouch.cli.replay import recover

    recover(Path(command.file), Path(command.out) if command.out else None)


def _live(command: Live) -> None:
    from pretouch.cli.live import live

    c = command
    live(c.profile, c.path, c.seed, c.record, c.host, c.port, c.keys, c.skin, c.units_host, c.units_port)


def _report(command: Report) -> None:
    from pretouch.cli.report import write_page

    limits = Path(command.limits) if command.limits else None
    print(f"Report: {write_page([Path(file) for file in command.files], Path(command.out), limits)}")


def _skin(command: Skin) -> int:
    from pretouch.cli.skin import skin

    return skin(command.what)


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
