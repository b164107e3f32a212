"""What a run of the avoidance benchmark leaves for readers."""

from pretouch_lab.benchmarks.ablations import BASE
from pretouch_lab.benchmarks.avoidance.figures import figures
from pretouch_lab.benchmarks.avoidance.scenario import scenarios
from pretouch_lab.benchmarks.avoidance.summary import results, summarise
from pretouch_lab.benchmarks.avoidance.tables import tables
from pretouch_lab.benchmarks.bench import Bench, Found
from pretouch_lab.rows import Row


def found(bench: Bench, rows: list[Row]) -> Found:
    """Return what the rows of a run came to."""
    summary = summarise(rows)
    counts = [cell["trials"] for cell in summary["cells"]]
    resolution = f"Resolution: {min(counts)} to {max(counts)} trials a cell, {bench.seeds} seeds."
    trials = sum(counts) + sum(cell["trials"] for cell in summary["ablations"] if cell["contender"] != BASE)
    about = (
        f"{trials} trials with {bench.seeds} seeds. Contenders: `blind` without proximity; `flacco` and `ding` as"
        " published, and each with another tuning ([baselines](../explanation/baselines.md)); `paper` with its"
        " restrictions, soft; `paper-off` without them."
    )
    scenes = [
        f"- **{family}**: {text}"
        for family, text in {s.family: s.text for s in scenarios().values()}.items()
        if any(cell["family"] == family for cell in summary["cells"])
    ]
    text = "\n\n".join([about, "\n".join(scenes)])
    return Found(results(summary, bench), tables(summary), resolution, figures(summary, rows), text, _holds(summary))


def _holds(summary: Row) -> str:
    """Say why arms held."""
    reasons: dict[str, dict[str, int]] = {}
    for cell in summary["cells"]:
        for reason, times in cell["hold_reasons"].items():
            of = reasons.setdefault(reason, {})
            of[cell["contender"]] = of.get(cell["contender"], 0) + times
    if not reasons:
        return ""
    lines = [f"- {reason} ({', '.join(f'{c} {n}' for c, n in by.items())})" for reason, by in reasons.items()]
    return "\n\n".join(["Why arms held (times, # for a number):", "\n".join(lines)])
