"""The command `pretouch replay`: a recording is summarised, recomputed, compared or shown."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro
from rich.console import Console
from rich.progress import Progress

from pretouch.cli.options import JsonFile
from pretouch.cli.tables import show
from pretouch.cli.warm_up import prepare
from pretouch.cli.writing import STANDARD_OUTPUT, numbers_to
from pretouch.page.server import ServeOptions, begun, browser_here
from pretouch.profiles import profile as find_profile
from pretouch.recording.compare import Comparison, DetectedContact, compare
from pretouch.recording.reader import Recorded, open_recording
from pretouch.recording.verify import verify as recompute
from pretouch.signals import ended
from pretouch.text_table import TextTable
from pretouch.types import Mode

if TYPE_CHECKING:
    from viser import ViserServer


@dataclass(frozen=True)
class Replay:
    """View a recording on the page, recompute it, or compare it with what another profile would have detected."""

    file: tyro.conf.Positional[Path]
    """Recording; that of a killed process works too."""
    verify: bool = False
    """Recompute every step, and report the first that differs; the exit code is then 1. Opens no page."""
    profile: str = ""
    """Profile whose decisions on the same force and range data are shown beside the recorded ones."""
    page: bool = True
    """Open the page; --no-page only prints."""
    json: JsonFile = None
    host: str = "127.0.0.1"
    """Address to serve the page at. Beyond this machine, whoever has the printed address sees the recording."""
    port: int = 8080
    """Port to serve the page at."""

    def run(self) -> int:
        """Summarise the recording, and check, compare or show it; the page's address is printed before the reading.

        The exit code is 1 if a step differs when it is recomputed.
        """
        with ExitStack() as stack:
            page = None
            if self.page and not self.verify and self.file.is_file():
                options = ServeOptions(self.host, self.port, browser_here())
                say = partial(print, file=sys.stderr if str(self.json) == STANDARD_OUTPUT else None, flush=True)
                page = stack.enter_context(
                    begun(options, self.file.name, "The recording", "see the recording, and play it", say)
                )
            return self._replay(page)

    def _replay(self, page: "Callable[[], ViserServer] | None") -> int:
        console = Console(highlight=False, soft_wrap=True)
        other = find_profile(self.profile) if self.profile else None
        with numbers_to(self.json) as write:
            recorded = open_recording(self.file)
            numbers = _described(recorded)
            what_ran = _what_ran(recorded, numbers)
            if recorded.sentence:
                console.print(recorded.sentence, markup=False)
            if page and not self.verify and not self.json:
                console.print(f"{what_ran}.", markup=False)
            else:
                with _progress("Reading", len(recorded)) as advance:
                    events = _events(recorded, advance)
                contacts, holds = _many(events["contacts"], "contact"), _many(events["holds"], "hold")
                holding = f"held for {events['held_share']:.0%} of the time"
                console.print(f"{what_ran}: {contacts}, {holds} after the start, {holding}.", markup=False)
                numbers |= events
            verdict = None
            if self.verify:
                prepare(recorded.runs[0].profile)
                with _progress("Recomputing", len(recorded)) as advance:
                    numbers["verified"] = verdict = recompute(recorded, advance)
                console.print(verdict.sentence, markup=False)
            elif other:
                with _progress("Comparing", len(recorded)) as advance:
                    comparison = compare(recorded, other, advance)
                _show(console, comparison)
                numbers["compared"] = {
                    "other": comparison.other.name,
                    "contacts": [{"recorded": mine, "other": theirs} for mine, theirs in comparison.pairs],
                    "left_out": comparison.left_out,
                }
            write(numbers)
            if page and not self.verify:
                from pretouch.page.replay import show_replay  # needs the extra

                show_replay(recorded, page(), ended)
        return int(verdict is not None and not verdict.agrees)


@contextmanager
def _progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on standard error, and yield the function that advances it."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


def _described(recorded: Recorded) -> dict[str, Any]:
    """Return the facts of a recording, for JSON."""
    stamps, run = recorded.stamps(), recorded.runs[0]
    return {
        "recording": str(recorded.place),
        "complete": recorded.complete,
        "arm": run.model.description.name,
        "profiles": [run.profile.name for run in recorded.runs],
        "units": [unit.id for unit in run.skin.mounted],
        "steps": len(recorded),
        "duration_s": stamps[-1] - stamps[0],
    }


def _what_ran(recorded: Recorded, facts: dict[str, Any]) -> str:
    """Return a line on the run and its duration."""
    command = recorded.runs[0].about.get("command")
    what, profiles = f"{command}: " if isinstance(command, str) else "", ", then ".join(facts["profiles"])
    return (
        f"{what}profile {profiles} on {facts['arm']} with {_many(len(facts['units']), 'unit')},"
        f" {facts['duration_s']:.1f} s, {_many(facts['steps'], 'step')}"
    )


def _events(recorded: Recorded, advance: Callable[[int], None]) -> dict[str, Any]:
    """Count contacts and holds after the initial hold of each arm; `advance` receives the number of read steps."""
    modes, contacts = list[Mode](), 0
    for i, cycle in enumerate(recorded):
        contacts += cycle.step.contact is not None
        modes.append(cycle.step.mode)
        advance(i + 1)
    holds = sum(mode is Mode.HOLD and before is not Mode.HOLD for before, mode in pairwise(modes))
    return {"contacts": contacts, "holds": holds, "held_share": modes.count(Mode.HOLD) / len(modes)}


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _show(console: Console, comparison: Comparison) -> None:
    title = f"Contacts: {comparison.recorded.name} as recorded, {comparison.other.name} on the same data"
    rows = [(*_cells(a), *_cells(b), f"{b.time_s - a.time_s:+.2f}" if a and b else "") for a, b in comparison.pairs]
    header = "recorded at [s]", "force [N]", "axes", "other at [s]", "force [N]", "axes", "later by [s]"
    note = "Detector only: both use the recorded motion of the arm, which another profile would have changed."
    if comparison.left_out:
        note += f" {_many(comparison.left_out, 'step')} left out, without usable inputs in the recording."
    show(console, [TextTable(title, header, tuple(rows) or (("none", "", "", "none", "", "", ""),), note, 0)])


def _cells(contact: DetectedContact | None) -> tuple[str, str, str]:
    return ("-", "", "") if contact is None else (f"{contact.time_s:.3f}", f"{contact.norm_n:.1f}", contact.axes)
