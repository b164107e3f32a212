"""A benchmark's tasks in the terminal: how long they take, and how far they are."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:  # the help is to need none of the heavy packages
    from pretouch_lab.benchmarks.store import Task

T = TypeVar("T")


def worked(name: str, tasks: "list[Task]", work: "Callable[[Callable[[float], None]], T]") -> T:
    """Say how long tasks take, and show how far `work(progress)` is, which calls `progress(cost)` after each."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from pretouch_lab.benchmarks.store import expected, missing

    console = Console(stderr=True)
    console.print(f"{name.capitalize()}: {len(tasks)} pieces of work, {expected(tasks)}.", highlight=False)
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:.0f} %")
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console) as bar:
        total, left = (sum(task.cost for task in some) for some in (tasks, missing(tasks)))
        shown = bar.add_task(name, total=total)
        bar.update(shown, completed=total - left)
        return work(lambda cost: bar.update(shown, advance=cost))
