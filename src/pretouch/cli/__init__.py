"""The command `pretouch`."""

from itertools import count
from pathlib import Path

import tyro
from rich.console import Console

from pretouch.cli.bench_avoidance import Avoidance
from pretouch.cli.bench_both import Both
from pretouch.cli.bench_detection import Detection
from pretouch.cli.bench_localization import Localization
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
from pretouch.cli.ending import Terminated, ends_raise, exit_code
from pretouch.cli.identify import Identify
from pretouch.cli.robot_commands import Check, Import, Robot
from pretouch.cli.run.options import Run
from pretouch.cli.serve_fci_command import ServeFci
from pretouch.cli.skin_commands import Skin
from pretouch.cli.sweep import Sweep
from pretouch.cli.words import words
from pretouch.errors import ParameterError, PretouchError

# the rest of the package takes a second to import: only the functions that run something do

_USAGE, _INTERRUPTED = 2, 130
_DEMONSTRATED = ("blind", "paper", "pretouch")


def main(args: list[str] | None = None) -> int:
    """Run the command; return its exit code: 2 for bad input, 130, 143 or 129 after Ctrl-C, SIGTERM or SIGHUP."""
    errors = Console(stderr=True, soft_wrap=True, highlight=False)
    try:
        with ends_raise():
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
                case Bench(Detection() as what):
                    _bench_detection(what)
                case Bench(Avoidance() as what):
                    _avoidance(what)
                case Bench(Localization() as what):
                    _localization(what)
                case Bench(Both() as what):
                    _both(what)
                case Bench(FreeMotion() as what):
                    _free_motion(what)
                case Bench(Cycle() as what):
                    _cycle(what)
                case Sweep():
                    _sweep(command)
                case Live():
                    _live(command)
                case Replay():
                    return _replay(command)
                case Recover():
                    _recover(command)
                case Detect():
                    _detect(command)
                case Identify():
                    _identify(command)
                case Report():
                    _report(command)
                case Skin():
                    return _skin(command)
                case WarmUp():
                    _warm_up()
                case Robot():
                    _robot(command)
                case ServeFci():
                    _serve_fci(command)
                case Run():
                    return _run(command) or exit_code()
    except PretouchError as error:
        errors.print(str(error), markup=False)
        return _USAGE
    except (KeyboardInterrupt, Terminated):
        return exit_code() or _INTERRUPTED
    return exit_code()


def _demo(command: Demo) -> None:
    from pretouch.cli.campaigns import run_all
    from pretouch.experiments.campaign import Request

    out = Path(command.out) if command.out else _new_folder("demo")
    few = Request(("avoidance", "dynamic"), seeds=1, profiles=_DEMONSTRATED)
    many = Request(("static",), seeds=command.seeds, profiles=_DEMONSTRATED)
    run_all([(many, out / "static"), (few, out / "people")], out, out / "results.json")


def _new_folder(name: str) -> Path:
    return next(path for n in count(1) if not (path := Path("runs") / f"{name}-{n}").exists())


def _reproduce(command: Reproduce) -> None:
    from pretouch.cli.campaigns import run_all
    from pretouch.experiments.campaign import Request
    from pretouch.experiments.paper import whole_paper
    from pretouch.experiments.registry import EXPERIMENTS
    from pretouch.experiments.worlds import folder_part

    everything = command.experiment == "all"
    request = Request(
        experiments=tuple(EXPERIMENTS) if everything else (command.experiment,),
        seeds=command.seeds,
        profiles=words(command.profiles),
        restrictions=words(command.restrictions),
        orientation=command.orientation or None,
        stiffness=tuple(map(_number, words(command.stiffness))),
        skin=command.skin or None,
        record=command.record,
        arm=command.arm or None,
        first_seed=command.first_seed,
        world=command.world or None,
    )
    if request.arm and not everything:
        context = request.context()
        print(context.placement.sentence(context.model.description.name))
    out = Path(command.out or f"runs/reproduce-{command.experiment}{folder_part(command.world)}")
    runs = [(part, out / name) for name, part in whole_paper(request)] if everything else [(request, out)]
    run_all(runs, out, Path(command.json) if command.json else out / "results.json")


def _figure(command: Figure) -> None:
    from pretouch.cli.figure import draw_figure

    run = Path(command.run) if command.run else None
    out = Path(command.out or f"{command.name}.png")
    print(f"Figure: {draw_figure(command.name, run, out, command.profile, command.seed)}")


def _bench_detection(command: Detection) -> None:
    from pretouch.cli.bench_detection import bench_detection

    bench_detection(command)


def _both(command: Both) -> None:
    from pretouch.cli.bench_both import bench_both

    bench_both(command)


def _localization(command: Localization) -> None:
    from pretouch.cli.bench_localization import bench_localization

    bench_localization(command)


def _avoidance(command: Avoidance) -> None:
    from pretouch.cli.bench_avoidance import bench_avoidance

    bench_avoidance(command)


def _free_motion(command: FreeMotion) -> None:
    from pretouch.cli.campaigns import run_all
    from pretouch.experiments.campaign import Request

    out = Path(command.out or "runs/bench-free-motion")
    request = Request(("free-motion",), command.seeds)
    run_all([(request, out)], out, Path(command.json) if command.json else out / "results.json")


def _sweep(command: Sweep) -> None:
    from pretouch.cli.sweep import sweep

    sweep(command)


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
    detect(Path(c.file), choice, words(c.profiles), skin, c.rate, out, json)


def _identify(command: Identify) -> None:
    from pretouch.cli.identify import identify_arm

    identify_arm(command)


def _replay(command: Replay) -> int:
    from pretouch.cli.replay import replay

    c = command
    return replay(Path(c.file), c.verify, c.profile, c.page, c.host, c.port)


def _recover(command: Recover) -> None:
    from pretouch.cli.replay import recover

    recover(Path(command.file), Path(command.out) if command.out else None)


def _live(command: Live) -> None:
    from pretouch.cli.live import live

    live(command)


def _report(command: Report) -> None:
    from pretouch.cli.report import write_page

    limits = Path(command.limits) if command.limits else None
    print(f"Report: {write_page([Path(file) for file in command.files], Path(command.out), limits)}")


def _skin(command: Skin) -> int:
    from pretouch.cli.skin import skin

    return skin(command.what)


def _run(command: Run) -> int:
    from pretouch.cli.run.command import run

    return run(command)


def _robot(command: Robot) -> None:
    match command.what:
        case Import():
            from pretouch.cli.robot_import import import_arm

            import_arm(command.what)
        case Check():
            from pretouch.cli.robot_check import check_arm

            check_arm(command.what)


def _serve_fci(command: ServeFci) -> None:
    from pretouch.cli.serve_fci import serve_fci

    serve_fci(command)


def _warm_up() -> None:
    from pretouch.cli.warm_up import compile_step

    kept = compile_step()
    print(
        f"Compiled, and kept in {kept}." if kept else "Compiled, but there is nowhere to keep it: HOME is not writable."
    )


def _counts(text: str) -> tuple[int, ...]:
    numbers = words(text)
    if not numbers or not all(number.isdecimal() for number in numbers):
        raise ParameterError(f"The numbers of points are {text!r}: give whole numbers, separated by commas.")
    return tuple(map(int, numbers))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"The stiffness is {text!r}: give numbers in N/m, separated by commas.") from None
