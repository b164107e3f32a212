"""The avoidance benchmark's part of docs/results/benchmarks.md."""

from pathlib import Path

from pretouch.text_table import markdown
from pretouch_lab.benchmarks import documents
from pretouch_lab.benchmarks.ablations import BASE
from pretouch_lab.benchmarks.avoidance.scenario import scenarios
from pretouch_lab.benchmarks.avoidance.tables import tables
from pretouch_lab.benchmarks.documents import shown
from pretouch_lab.benchmarks.store import Row
from pretouch_lab.experiment import Picture

PART = "avoidance"


def section(summary: Row, pictures: list[Picture], seeds: str) -> str:
    """Return the part as Markdown."""
    made = tables(summary)
    trials = sum(cell["trials"] for cell in summary["cells"])
    trials += sum(cell["trials"] for cell in summary["ablations"] if cell["contender"] != BASE)
    about = (
        f"{trials} trials with {seeds} seeds. Contenders: `blind` without proximity; `flacco` and `ding` as published,"
        " and each with another tuning ([baselines](../explanation/baselines.md)); `paper` with its restrictions, soft;"
        " `paper-off` without them."
    )
    scenes = [
        f"- **{family}**: {text}"
        for family, text in {s.family: s.text for s in scenarios().values()}.items()
        if any(cell["family"] == family for cell in summary["cells"])
    ]
    return "\n\n".join([about, "\n".join(scenes), *map(shown, pictures), *_holds(summary), *map(markdown, made)])


def publish(summary: Row, pictures: list[Picture], seeds: str, out: Path, docs: Path | None) -> list[Path]:
    """Write the figures into the run's folder, or with `docs` into its images, and there the part of the document."""
    return documents.publish(PART, section(summary, pictures, seeds), pictures, out, docs)


def _holds(summary: Row) -> list[str]:
    """Say why arms held."""
    reasons: dict[str, dict[str, int]] = {}
    for cell in summary["cells"]:
        for reason, times in cell["hold_reasons"].items():
            of = reasons.setdefault(reason, {})
            of[cell["contender"]] = of.get(cell["contender"], 0) + times
    if not reasons:
        return []
    lines = [f"- {reason} ({', '.join(f'{c} {n}' for c, n in by.items())})" for reason, by in reasons.items()]
    return ["Why arms held (times, # for a number):", "\n".join(lines)]
