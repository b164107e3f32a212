"""`pretouch bench both`: both benchmarks, and which of the goals of `pretouch` were reached."""

from dataclasses import dataclass
from pathlib import Path

from pretouch_lab.cli.bench_avoidance import Avoidance, bench_avoidance
from pretouch_lab.cli.bench_detection import Detection, bench_detection
from pretouch_lab.cli.bench_options import BenchOptions


@dataclass(frozen=True)
class Both(BenchOptions):
    """Run the benchmarks detection and avoidance, and say which goals were reached.

    About an hour and a half on two processors, with --quick ten minutes. A run that was stopped goes on with the same
    --out.
    """

    readme: str = ""
    """Document for the one table, between its marks; by default none."""

    def run(self) -> None:
        """Run both, with tables, figures and numbers."""
        bench_both(self)


def bench_both(command: Both) -> None:
    """Run what is missing of both, and show and write what came out of them together."""
    import json

    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch.text_table import markdown
    from pretouch_lab.benchmarks.documents import DOCUMENT, around, put
    from pretouch_lab.benchmarks.front import front_table
    from pretouch_lab.benchmarks.goals import goal_table

    out, docs = command.folder("bench"), command.documents
    if command.readme:
        command.check_published("--readme")
    readme = Path(command.readme) if command.readme else None
    parts = ("detection", "avoidance", "goals") if docs else ()
    places = [(docs / DOCUMENT, part) for part in parts if docs] + ([(readme, "front")] if readme else [])
    for document, part in places:
        around(document, part)  # an hour later would be late
    given = {"quick": command.quick, "seeds": command.seeds, "docs": command.docs, "world": command.world}
    bench_detection(Detection(out=str(out / "detection"), **given))  # type: ignore[arg-type]  # of both the same
    bench_avoidance(Avoidance(out=str(out / "avoidance"), **given))  # type: ignore[arg-type]
    detection, avoidance = (
        json.loads((out / name / "results.json").read_text(encoding="utf-8")) for name in ("detection", "avoidance")
    )
    made = {"goals": goal_table(detection, avoidance), "front": front_table(detection, avoidance)}
    show(Console(highlight=False), made.values())
    for document, part in places:
        if part in made:
            put(document, part, markdown(made[part]))
            print(f"Written: {document}")
