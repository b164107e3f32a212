"""How far long work is, in the terminal."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from rich.console import Console

    from pretouch_lab.engine import Progress, Task

Advance = Callable[[float, str], None]
"""Called with the cost of what was done, and what the bar is to be named from then on."""


@contextmanager
def bar(console: "Console", name: str, total: float, done: float = 0.0) -> Iterator[Advance]:
    """Show a bar with the time it took and still takes."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:.0f} %")
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console) as shown:
        task = shown.add_task(name, total=total)
        shown.update(task, completed=done)
        yield lambda cost, called: shown.update(task, advance=cost, description=called)


def worked(name: str, tasks: "list[Task]", work: "Callable[[Progress], None]") -> None:
    """Say how long tasks take, whose costs are in seconds of a processor, and show how far `work(progress)` is."""
    from rich.console import Console

    from pretouch_lab.engine import missing

    console, count = Console(stderr=True), os.cpu_count() or 1
    total, left = (sum(task.cost for task in some) for some in (tasks, missing(tasks)))
    console.print(
        f"{name.capitalize()}: {len(tasks)} pieces of work, about {total / count / 60:.0f} min on {count}"
        f" processor{'s' if count > 1 else ''}, {left / count / 60:.0f} of them left.",
        highlight=False,
    )
    with bar(console, name, total, total - left) as advance:
        work(lambda cost: advance(cost, name))
