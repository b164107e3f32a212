"""Prints measures of the repository beside their aims, and fails if one exceeds its bound.

A bound is what has been reached, in `bounds.toml`, and is only ever lowered: a test compares it with the commit before.
What does not fit waits until something else has gone.
"""

import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.house.source import Source, import_cycle

ROOT = Path(__file__).parents[2]
BOUNDS = Path(__file__).with_name("bounds.toml")

_PACKAGES = {
    "pretouch": ROOT / "src/pretouch",
    "pretouch-fci": ROOT / "fci/src",
    "pretouch-ros2": ROOT / "ros2/src",
    "pretouch-lab": ROOT / "lab/src",
}
_TESTS = ("tests", "fci/tests", "ros2/tests", "lab/tests")
_CORE_FOLDERS = ("control", "contact", "perception", "robot", "sensing", "params")
_RIM = frozenset(
    {
        "__init__",
        "atomic_write",
        "errors",
        "extras",
        "loop",
        "plain_text",
        "plugins",
        "ports",
        "realtime",
        "shielding",
        "signals",
        "source_digest",
        "text_table",
        "toml_files",
        "traces",
    }
)
"""Modules at the top of the product that are no part of the core."""


@dataclass(frozen=True)
class Measure:
    """A measure of the repository with its aim."""

    name: str
    value: int
    aim: int
    where: str = ""


def measures() -> Iterator[Measure]:
    """Yield all measures of the repository."""
    packages = {name: _source(folder) for name, folder in _PACKAGES.items()}
    product, core = packages["pretouch"], _core(_PACKAGES["pretouch"])
    yield Measure("pretouch: lines", product.lines, 36_000)
    yield Measure("pretouch: files", len(product.files), 280)
    yield Measure("its core: lines", core.lines, 11_500)
    yield Measure("its core: files", len(core.files), 70)
    for name, aim in (("pretouch-fci", 3_600), ("pretouch-ros2", 2_000), ("pretouch-lab", 9_000)):
        yield Measure(f"{name}: lines", packages[name].lines, aim)
    yield Measure("tests: lines", sum(_source(ROOT / folder).lines for folder in _TESTS), 45_000)
    whole = Source((path for folder in _PACKAGES.values() for path in folder.rglob("*.py")), ROOT)
    yield Measure("fmt: skip", whole.format_skips, 20)
    yield Measure("class names used twice", len(whole.repeated_classes), 5)
    yield Measure("participles as variables", whole.participles, 60)
    file, lines = max(whole.files.items(), key=lambda item: item[1])
    yield Measure("lines of the largest file", lines, 350, str(file))
    longest, widest = max(whole.functions, key=lambda f: f.lines), max(whole.functions, key=lambda f: f.parameters)
    yield Measure("lines of the longest function", longest.lines, 60, longest.place)
    yield Measure("most parameters of a function", widest.parameters, 8, widest.place)
    cycle = import_cycle([name.replace("-", "_") for name in _PACKAGES])
    yield Measure("modules in an import cycle", len(cycle), 0, " > ".join(cycle))


def _source(folder: Path) -> Source:
    return Source(folder.rglob("*.py"), ROOT)


def _core(product: Path) -> Source:
    files = [path for folder in _CORE_FOLDERS for path in (product / folder).rglob("*.py")]
    return Source([*files, *(path for path in product.glob("*.py") if path.stem not in _RIM)], ROOT)


def bounds(text: str) -> dict[str, int]:
    """Read the bounds by the names of their measures."""
    return tomllib.loads(text)


def main() -> int:
    """Print the measures; return 1 if one exceeds its bound or has none."""
    limits, beyond = bounds(BOUNDS.read_text()), []
    print(f"{'':32}{'now':>8}{'bound':>8}{'aim':>8}")
    for measure in measures():
        limit = limits.get(measure.name, -1)
        if measure.value > limit:
            beyond.append(measure.name)
        mark = "BEYOND " if measure.value > limit else ""
        print(f"{measure.name:32}{measure.value:8}{limit:8}{measure.aim:8}  {mark}{measure.where}".rstrip())
    if beyond:
        print(f"Beyond the bound: {', '.join(beyond)}. Take something else away; a bound is never raised.")
    return int(bool(beyond))


if __name__ == "__main__":
    sys.exit(main())
